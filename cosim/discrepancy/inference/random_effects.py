"""Random effects for the nuisance errors of a drive: poses, objects, map and reflectances.

Each error is a random effect with mean zero whose variance is estimated from the data (variance components). In the
mixed model, a missing effect is only significant if it explains more than these errors can: the uncertainty of the mean
of all pose errors follows from their standard deviation and the number of scans, that of an offset common to all cars
from the number of cars.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy import sparse, special

from assets.materials import MOST_MATERIALS
from cosim.discrepancy.inference.clusters import Clusters, joined_cells
from cosim.discrepancy.inference.pose_errors import PoseErrors
from cosim.discrepancy.inference.score import Evidence, Factored, Quantity, SparseMatrix, scaled, side_by_side
from cosim.discrepancy.sampling.sample import Prediction, Sample

_AXES = 6
_LEVEL = 4  # smallest number of a facing of level surfaces, see `Sample.facing`


@dataclass(frozen=True, eq=False)
class Block:
    """Random effects of one kind.

    Attributes:
        name: poses, objects, objects_by_scan, map, albedo or albedo_of_map.
        part: source of error in the budget that it belongs to.
        quantity: quantity that it changes.
        size: number of random effects.
        group: (size,) int index of the variance component of each.
        start: initial standard deviation of each variance component (in the unit of the random effect).
        free: whether the prior is flat: the variances keep their large initial values.
    """

    name: str
    part: str
    quantity: Quantity
    size: int
    group: np.ndarray
    start: tuple[float, ...]
    free: bool = False


@dataclass(frozen=True, eq=False)
class Estimate:
    """Random effects and their variances.

    Attributes:
        u: (m,) best linear unbiased predictions of the random effects.
        variance: (v,) variance components; 0 for components that are switched off.
        surface_spread: (2, k) factors on the stated σ of the twin's surfaces, by row of the material table: of all of
            it, and of the part that neighbouring beams do not have in common.
    """

    u: np.ndarray
    variance: np.ndarray
    surface_spread: np.ndarray = field(default_factory=lambda: np.ones((2, MOST_MATERIALS)))


class RandomEffects:
    """The random effects of a sample.

    The m random effects are ordered by block: poses (6 per scan: shifts [m], then rotations [rad], LiDAR axes), objects
    (4 per object: shifts [m] in world axes and rotation about the vertical [rad]), the same per object and scan, map
    cells (shift along the normal [m]), albedo of objects and of map cells (relative change).

    Args:
        sample: sample of measured beams.
        has_poses: whether poses have errors.

    Attributes:
        component: (m,) int variance component of each random effect.
    """

    def __init__(self, sample: Sample, *, has_poses: bool = True) -> None:
        self.sample, settings = sample, sample.settings.random_effects
        self._settings = settings
        self._pose_errors = PoseErrors(
            sample.pose_derivative, sample.frame, sample.range_m, len(sample.names), settings
        )
        scans, things = len(sample.names), sample.instance >= 0
        self._track = np.where(things, np.unique(np.where(things, sample.track, -1), return_inverse=True)[1], -1)
        if not things.all():
            self._track[things] -= 1
        tracks, seen = int(self._track.max(initial=-1)) + 1, int(sample.object_scan.max(initial=-1)) + 1
        cells = int(sample.surface.max(initial=-1)) + 1
        axes, free = np.array([0, 0, 1, 2]), sample.of_own_map
        # The ground of a map is often more accurate than the positions of buildings and poles.
        is_upright = np.zeros(cells, int)
        if not free:
            is_upright[sample.surface[sample.surface >= 0]] = sample.facing[sample.surface >= 0] < _LEVEL
        of_map = (settings.free_map_m,) if free else (0.0, 0.0)
        blocks = []
        if has_poses and not sample.own_axes:
            own = (settings.pose_shift_m,) * 3 + (settings.pose_turn_rad,) * 3
            start = settings.free_poses if free else own
            blocks.append(Block("poses", "poses", "range", 6 * scans, np.tile(np.arange(6), scans), start, free))
        blocks += [
            Block("objects", "objects", "range", 4 * tracks, np.tile(axes, tracks), (0.0, 0.0, 0.0)),
            Block("objects_by_scan", "objects", "range", 4 * seen, np.tile(axes, seen), (0.0, 0.0, 0.0)),
            Block("map", "map", "range", cells, is_upright, of_map, free),
        ]
        if sample.has_intensity:
            blocks.append(Block("albedo", "objects", "intensity", tracks, np.zeros(tracks, int), (0.0,)))
            start = (settings.free_albedo if free else 0.0,)
            blocks.append(Block("albedo_of_map", "map", "intensity", cells, np.zeros(cells, int), start, free))
        self.blocks: tuple[Block, ...] = tuple(block for block in blocks if block.size)
        sizes = [block.size for block in self.blocks]
        self._ends = np.cumsum([0, *sizes])
        first_component = np.cumsum([0, *(len(block.start) for block in self.blocks)])
        self.component = np.concatenate(
            [block.group + first for block, first in zip(self.blocks, first_component, strict=False)]
            or [np.zeros(0, int)]
        )
        self.components = tuple((block.name, row) for block in self.blocks for row in range(len(block.start)))
        self._is_flat = np.array([block.free for block in self.blocks for _ in block.start], bool)
        least = dict.fromkeys(("objects", "objects_by_scan"), settings.least_objects)
        least |= {"poses": settings.least_poses, "map": (settings.least_map_m,) * 2}
        self._least = np.array([least.get(name, (settings.least_albedo,))[row] ** 2 for name, row in self.components])
        self._designs = {
            block.name: self._range_design(block)
            for block in self.blocks
            if block.name != "poses" and block.quantity == "range"
        }

    @property
    def has_poses(self) -> bool:
        """Whether poses have errors with a proper (not flat) prior."""
        return any(block.name == "poses" and not block.free for block in self.blocks)

    @property
    def size(self) -> int:
        """Number m of random effects."""
        return int(self._ends[-1])

    @cached_property
    def independent_blocks(self) -> np.ndarray:
        """(m,) int group of each random effect such that each beam depends on at most one group; −1 for poses.

        All range errors of one object, in all scans, are one group. Each map cell and each albedo is its own group.
        """
        sample, group = self.sample, np.full(self.size, -1)
        things = sample.object_scan >= 0
        track_of_scan = np.zeros(int(sample.object_scan.max(initial=-1)) + 1, int)
        track_of_scan[sample.object_scan[things]] = self._track[things]
        tracks, first = int(self._track.max(initial=-1)) + 1, 0
        for name, unit in (
            ("objects", np.repeat(np.arange(tracks), 4)), ("objects_by_scan", np.repeat(track_of_scan, 4)),
        ):  # fmt: skip
            rows = self.rows(name)
            group[rows] = unit[: rows.stop - rows.start]
        first = tracks
        for name in ("map", "albedo", "albedo_of_map"):
            rows = self.rows(name)
            count = rows.stop - rows.start
            group[rows] = first + np.arange(count)
            first += count
        return group

    @cached_property
    def clusters(self) -> Clusters:
        """Clusters of the beams and random effects, for robust (sandwich) variances."""
        return self.clusters_of(True, -(-self._settings.fewest_parts // max(len(self.sample.names), 1)))

    def clusters_of(self, positions: bool, sectors: int) -> Clusters:
        """Clusters of the beams and random effects, each scan divided into this number of azimuth sectors.

        Map cells are joined to larger squares: all walls of a displaced building share its error, while errors of
        reflectances extend less far.

        Args:
            positions: whether errors of positions are meant, or of reflectances.
            sectors: number of sectors.
        """
        sample, by = self.sample, self._settings
        cluster = joined_cells(sample, by.dependent_cells if positions else by.reflectance_cells)
        sector = np.minimum(((sample.azimuth + np.pi) / (2 * np.pi) * sectors).astype(int), sectors - 1)
        track, scan = np.full(self.size, -1), np.full(self.size, -1)
        poses = self.rows("poses")
        scan[poses] = np.arange(poses.stop - poses.start) // _AXES
        for name, number, each in (
            ("objects", self._track, 4), ("objects_by_scan", sample.object_scan, 4), ("map", sample.surface, 1),
            ("albedo", self._track, 1), ("albedo_of_map", sample.surface, 1),
        ):  # fmt: skip
            rows, used = self.rows(name), number >= 0
            if rows.stop > rows.start:
                of_unit = np.zeros((rows.stop - rows.start) // each, int)
                of_unit[number[used]] = cluster[used]
                track[rows] = np.repeat(of_unit, each)
        return Clusters(cluster, sample.frame, sample.frame * sectors + sector, track, scan)

    def start(self) -> Estimate:
        """Return the default initial estimate: all random effects 0, initial variances from the settings."""
        variance = np.array([value**2 for one in self.blocks for value in one.start])
        return Estimate(np.zeros(self.size), variance)

    def without(self, estimate: Estimate, names: Sequence[str]) -> Estimate:
        """Return an initial estimate with the named kinds of random effects switched off."""
        is_off = np.array([name in names for name, _ in self.components])
        return replace(estimate, u=np.zeros(self.size), variance=np.where(is_off, 0.0, estimate.variance))

    def warm_start(self, other: RandomEffects | None, estimate: Estimate | None) -> Estimate:
        """Return an initial estimate from a fit to another sample of the same drive, or the default one without it."""
        if other is None or estimate is None or other.components != self.components:
            return self.start()
        return replace(estimate, u=self._transfer(other, estimate, 0))

    def transferred(self, other: RandomEffects, estimate: Estimate, scan: int) -> Estimate:
        """Transfer the random effects from another sample that includes this sample's only scan.

        Args:
            other, estimate: random effects of the other sample and their estimate.
            scan: row of the scan in the other sample.
        """
        variance = np.where(estimate.variance[: len(self.components)] > 0, 1.0, 0.0)
        return replace(estimate, u=self._transfer(other, estimate, scan), variance=variance)

    def _transfer(self, other: RandomEffects, estimate: Estimate, scan: int) -> np.ndarray:
        """(m,) random effects that the other sample also has, from row `scan` of its scans on; 0 for all others."""
        u = np.zeros(self.size)
        for block in self.blocks:
            other_values = estimate.u[other.rows(block.name)]
            if not len(other_values):
                continue
            row_of_key = {key: row for row, key in enumerate(other._keys(block.name, 0))}
            rows = np.array([row_of_key.get(key, -1) for key in self._keys(block.name, scan)], int)
            own_values = u[self.rows(block.name)].reshape(len(rows), -1)
            own_values[rows >= 0] = other_values.reshape(len(row_of_key), -1)[rows[rows >= 0]]
        return u

    def _keys(self, name: str, scan: int) -> list[tuple]:
        """Key of each unit of one kind: scan number from `scan` on, or track name with scan number or facing."""
        sample = self.sample
        if name == "poses":
            return [(scan + row,) for row in range(len(sample.names))]
        number, more = {
            "objects": (self._track, np.zeros(len(sample), int)),
            "albedo": (self._track, np.zeros(len(sample), int)),
            "objects_by_scan": (sample.object_scan, scan + sample.frame),
            "map": (sample.surface, sample.facing),
            "albedo_of_map": (sample.surface, sample.facing),
        }[name]
        used = np.flatnonzero(number >= 0)
        _, first = np.unique(number[used], return_index=True)
        rows = used[first]
        return list(zip(sample.track_names[sample.track[rows]].tolist(), more[rows].tolist(), strict=True))

    def rows(self, name: str) -> slice:
        """Return the slice of the random effects of one kind; empty if there are none."""
        slices = (slice(int(a), int(b)) for a, b in pairwise(self._ends))
        return next((rows for block, rows in zip(self.blocks, slices, strict=True) if block.name == name), slice(0, 0))

    def _split(self, values: np.ndarray) -> Iterator[tuple[Block, np.ndarray]]:
        """Iterate over the blocks with their parts of values (m,)."""
        for block, (start, end) in zip(self.blocks, pairwise(self._ends), strict=True):
            yield block, values[start:end]

    def of_part(self, parts: Sequence[str]) -> np.ndarray:
        """(m,) bool whether each random effect belongs to one of the named sources of the budget."""
        mask = np.zeros(self.size, bool)
        for block, part in self._split(mask):
            part[:] = block.part in parts
        return mask

    def poses(self, estimate: Estimate) -> np.ndarray:
        """(scans, 6) pose errors [m, rad] in LiDAR axes; 0 if poses have no errors."""
        errors = estimate.u[self.rows("poses")].reshape(-1, _AXES)
        return errors if len(errors) else np.zeros((len(self.sample.names), _AXES))

    def spread(self, estimate: Estimate, name: str) -> np.ndarray:
        """Standard deviations of one kind by variance component; 0 for flat priors, empty if there are none."""
        variance = np.where(self._is_flat, 0.0, estimate.variance)
        return np.sqrt([v for (of, _), v in zip(self.components, variance, strict=True) if of == name])

    def precision(self, estimate: Estimate) -> np.ndarray:
        """(m,) inverse variances; practically infinite for random effects that are switched off."""
        return 1 / np.maximum(estimate.variance, 1e-30)[self.component]

    def active(self, estimate: Estimate) -> np.ndarray:
        """(m,) bool whether each random effect may differ from 0."""
        return (estimate.variance > 0)[self.component]

    def adjusted(self, expected: Prediction, estimate: Estimate) -> Prediction:
        """Return the prediction with the random effects applied."""
        moved = self._pose_errors.shift(self.poses(estimate), expected.range_m)
        for block, part in self._split(estimate.u):
            if block.name != "poses" and block.quantity == "range" and part.any():
                moved = moved + self._designs[block.name] @ part
        share = self.brightness(estimate)
        seen = self._seen(expected, share)
        spread, unshared = estimate.surface_spread[:, self.sample.material]
        return replace(
            self._brightened(expected, share),
            range_m=expected.range_m + moved,
            twin_sigma_m=expected.twin_sigma_m * spread,
            twin_unshared_m=expected.twin_unshared_m * unshared,
            seen=seen,
            silent=np.clip(expected.silent + expected.seen - seen, 0, 1),
        )

    def map_leverage(self, information: np.ndarray, estimate: Estimate) -> np.ndarray:
        """Leverage (n,) of ranges due to the positions of map surfaces, from the information (n,) of the beams."""
        block = next((block for block in self.blocks if block.name == "map"), None)
        if block is None:
            return np.zeros(len(information))
        squared = self._designs["map"].power(2)
        total = squared.T @ information + self.precision(estimate)[self.rows("map")]
        return information * (squared @ (1 / total))

    def brightened(self, expected: Prediction, estimate: Estimate) -> Prediction:
        """Return the prediction with the intensities that the albedos give; all else is unchanged."""
        return self._brightened(expected, self.brightness(estimate))

    def _brightened(self, expected: Prediction, share: np.ndarray) -> Prediction:
        spread = expected.intensity_sigma * (share if self.sample.of_own_map else 1.0)
        return replace(expected, intensity=expected.intensity * share, intensity_sigma=spread)

    def brightness(self, estimate: Estimate) -> np.ndarray:
        """(n,) factor by which the random effects change the intensities."""
        bright = np.zeros(len(self.sample))
        for block, part in self._split(estimate.u):
            if block.quantity == "intensity" and part.any():
                bright = bright + self._indicator_matrix(block) @ part
        return np.maximum(1 + bright, self._settings.darkest)

    def log_brightness(self, estimate: Estimate) -> float:
        """Sum of the logarithms of the factors on the reflectances of a map that was made from the scans.

        The Laplace approximation subtracts it, so that the priors of these factors are flat in their logarithm. With
        priors that are flat in the factors, models that predict lower intensities would be more likely only because
        each factor, and with it its uncertainty, is larger.
        """
        if not self.sample.of_own_map:
            return 0.0
        factors = 1 + estimate.u[self.rows("albedo_of_map")]
        return float(np.log(np.maximum(factors, self._settings.darkest)).sum())

    def _seen(self, expected: Prediction, share: np.ndarray) -> np.ndarray:
        """(n,) probability of a return if reflectances change by factors (n,): darker surfaces are lost more often.

        The log-odds are linear in small changes.
        """
        rows = np.flatnonzero((share != 1) & (expected.seen > 0) & (expected.seen < 1))
        if not len(rows):
            return expected.seen
        seen, slope = expected.seen.copy(), expected.log_odds_by_reflectance()
        seen[rows] = special.expit(special.logit(seen[rows]) + slope[rows] * (share[rows] - 1))
        return seen

    def prediction_jacobian(self, expected: Prediction, estimate: Estimate) -> dict[Quantity, np.ndarray]:
        """(n,) derivative of the adjusted prediction with respect to the effects' prediction, at the current estimate.

        Given for quantities where it may differ from 1: ranges of distant ground at grazing incidence depend
        nonlinearly on pose errors; intensities are scaled by the albedo if its prior is flat.
        """
        factors: dict[Quantity, np.ndarray] = {
            "range": self._pose_errors.range_derivative(self.poses(estimate), expected.range_m)
        }
        if self.sample.of_own_map:
            factors["intensity"] = self.brightness(estimate)
        return factors

    def designs(self, expected: Prediction, estimate: Estimate) -> dict[Quantity, SparseMatrix]:
        """(n, a) derivatives with respect to the active random effects, for each quantity that these change."""
        blocks: list[dict[Quantity, SparseMatrix]] = []
        for block, is_active in self._split(self.active(estimate)):
            if not is_active.any():
                continue
            if block.name == "poses":
                derivatives = self._pose_errors.slopes(self.poses(estimate), expected.range_m)
            elif block.quantity == "range":
                derivatives = self._designs[block.name]
            else:
                derivatives = self._intensity_design(block, expected)
            own: dict[Quantity, SparseMatrix] = {block.quantity: derivatives}
            if block.quantity == "intensity":
                own["drop"] = self._loss_design(block, expected, estimate)
            if not is_active.all():
                own = {name: matrix[:, np.flatnonzero(is_active)] for name, matrix in own.items()}
            blocks.append(own)
        widths = [next(iter(own.values())).shape[1] for own in blocks]
        quantities: list[Quantity] = list(dict.fromkeys(name for own in blocks for name in own))
        return {name: side_by_side([own.get(name) for own in blocks], widths) for name in quantities}

    def update_variances(self, estimate: Estimate, solver: Factored | None) -> Estimate:
        """Update the variances once by MacKay's fixed-point iteration (Neural Comput. 4, 1992): σ² = uᵀu/γ.

        γ is the effective number of degrees of freedom; traces are estimated with random probes (Hutchinson).

        Args:
            estimate: predictions u at the current variances.
            solver: factorised posterior precision ZᵀWZ + Λ of the active random effects.
        """
        used, variance = np.flatnonzero(self.active(estimate)), estimate.variance.copy()
        if solver is None:
            return estimate
        precision, component = self.precision(estimate)[used], self.component[used]
        signs = np.random.default_rng(0).choice((-1.0, 1.0), (len(used), self._settings.probes))
        posterior_variance = (signs * solver.solve(signs)).mean(1)
        effective_dof = np.bincount(component, 1 - precision * posterior_variance, len(variance))
        sum_of_squares = np.bincount(component, estimate.u[used] ** 2, len(variance))
        present, max_ratio = np.unique(component), self._settings.most_step
        new = sum_of_squares[present] / np.maximum(effective_dof[present], 0.5)
        variance[present] = np.clip(new, variance[present] / max_ratio, variance[present] * max_ratio)
        is_pose = np.array([name == "poses" for name, _ in self.components])
        variance = np.where(is_pose, np.maximum(variance, self._least), variance)
        variance = np.where(self._is_flat, estimate.variance, variance)
        is_negligible = (variance < self._least) & ~is_pose
        u = np.where(is_negligible[self.component], 0.0, estimate.u)
        return replace(estimate, u=u, variance=np.where(is_negligible, 0.0, variance))

    def initialise_variances(self, estimate: Estimate, expected: Prediction, evidence: Evidence) -> Estimate:
        """Initialise variances that are 0 although the data show variance, by the method of moments.

        An error that is common to the beams of a unit makes the square of the sum of their scores larger than the sum
        of the squares.

        Args:
            estimate, expected, evidence: current estimate, prediction and scores of the fit.
        """
        variance = estimate.variance.copy()
        initialised = dict[str, bool]()
        for index, block in enumerate(self.blocks):
            idle = [k for k, (name, _) in enumerate(self.components) if name == block.name and variance[k] <= 0]
            if not idle or block.quantity not in evidence.score or initialised.get(block.name.split("_by")[0]):
                continue
            matrix = self._designs[block.name] if block.quantity == "range" else self._intensity_design(block, expected)
            shared = matrix.T @ evidence.score[block.quantity]
            square = matrix.multiply(matrix)
            own = square.T @ evidence.score[block.quantity] ** 2
            information = square.T @ evidence.information[block.quantity]
            component = self.component[self._ends[index] : self._ends[index + 1]]
            for k in idle:
                members = component == k
                excess, total = (
                    float((shared[members] ** 2 - own[members]).sum()),
                    float((information[members] ** 2).sum()),
                )
                if (
                    excess > self._settings.variance_sigmas * np.sqrt(2 * float((own[members] ** 2).sum()))
                    and total > 0
                ):
                    variance[k] = max(excess / total, 4 * self._least[k])
                    initialised[block.name] = True  # the per-scan component is tested after the constant one is fitted
        return replace(estimate, variance=variance)

    def _intensity_design(self, block: Block, expected: Prediction) -> SparseMatrix:
        """(n, size) derivatives of intensities with respect to albedo."""
        return scaled(self._indicator_matrix(block), expected.intensity)

    def _loss_design(self, block: Block, expected: Prediction, estimate: Estimate) -> SparseMatrix:
        """(n, size) derivatives of the probability of a return with respect to albedo."""
        seen = self._seen(expected, self.brightness(estimate))
        return scaled(self._indicator_matrix(block), seen * (1 - seen) * expected.log_odds_by_reflectance())

    def _range_design(self, block: Block) -> SparseMatrix:
        """(n, size) derivatives of ranges with respect to object or map errors."""
        sample, rows = self.sample, np.arange(len(self.sample))
        if block.name == "map":
            used = np.flatnonzero(sample.surface >= 0)
            values, column = sample.surface_derivative[used], sample.surface[used]
            return sparse.csr_matrix((values, (used, column)), (len(rows), block.size))
        number = self._track if block.name == "objects" else sample.object_scan
        used = np.flatnonzero(number >= 0)
        columns = 4 * number[used][:, None] + np.arange(4)
        places = np.repeat(used, 4), columns.ravel()
        return sparse.csr_matrix((sample.object_derivative[used].ravel(), places), (len(rows), block.size))

    def _indicator_matrix(self, block: Block) -> SparseMatrix:
        """(n, size) indicator matrix: 1 where a beam hits the surface of the random effect."""
        if block.name not in self._designs:
            number = self._track if block.name == "albedo" else self.sample.surface
            used = np.flatnonzero(number >= 0)
            ones = np.ones(len(used))
            self._designs[block.name] = sparse.csr_matrix((ones, (used, number[used])), (len(number), block.size))
        return self._designs[block.name]
