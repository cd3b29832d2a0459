"""What is merely not known of a drive: errors of poses, of objects, of the map and of reflectances.

Each is a random effect of mean zero whose variance is estimated from the data. A mixed model with them asks of a
missing effect what they cannot explain: the common part of all pose errors of a drive is as sure as their spread and
the number of scans let it be, the offset that all cars share as sure as the number of cars does.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy import sparse

from cosim.discrepancy.inference.pose_errors import PoseErrors
from cosim.discrepancy.inference.score import Evidence, Factored, Quantity, SparseMatrix
from cosim.discrepancy.sampling.sample import Prediction, Sample

_AXES = 6


@dataclass(frozen=True, eq=False)
class Clusters:
    """What n beams share errors with: the thing or spot they meet, and their scan.

    Attributes:
        track: (n,) int: an instance, or a cell of the map.
        scan: (n,) int.
        part: (n,) int scan, or part of a scan where scans are few.
        unit_track, unit_scan: (m,) int which track or scan each random effect is of; −1 where it is of none.
    """

    track: np.ndarray
    scan: np.ndarray
    part: np.ndarray
    unit_track: np.ndarray
    unit_scan: np.ndarray


@dataclass(frozen=True, eq=False)
class Block:
    """Random effects of one kind.

    Attributes:
        name: poses, objects, objects_by_scan, map, albedo or albedo_of_map.
        part: the part of the budget that it belongs to.
        quantity: that it changes.
        size: how many.
        group: (size,) int which of its variances each has.
        start: initial standard deviation by variance.
        free: whether nothing is known of them, so that their variances stay as wide as they begin.
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
    """Values of the random effects and the variances of their laws.

    Attributes:
        u: (m,) best linear unbiased predictions.
        variance: (v,) of each law; 0 where there is none of it.
    """

    u: np.ndarray
    variance: np.ndarray


class RandomEffects:
    """The random effects of a sample.

    Args:
        sample: the measurements.
        has_poses: whether poses have errors.
    """

    def __init__(self, sample: Sample, *, has_poses: bool = True) -> None:
        self.sample, settings = sample, sample.settings.unsure
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
        blocks = []
        if has_poses and not sample.own_axes:
            own = (settings.pose_shift_m,) * 3 + (settings.pose_turn_rad,) * 3
            start = settings.free_poses if free else own
            blocks.append(Block("poses", "poses", "range", 6 * scans, np.tile(np.arange(6), scans), start, free))
        blocks += [
            Block("objects", "objects", "range", 4 * tracks, np.tile(axes, tracks), (0.0, 0.0, 0.0)),
            Block("objects_by_scan", "objects", "range", 4 * seen, np.tile(axes, seen), (0.0, 0.0, 0.0)),
            Block("map", "map", "range", cells, np.zeros(cells, int), (settings.free_map_m if free else 0.0,), free),
        ]
        if sample.has_intensity:
            blocks.append(Block("albedo", "objects", "intensity", tracks, np.zeros(tracks, int), (0.0,)))
            start = (settings.free_albedo if free else 0.0,)
            blocks.append(Block("albedo_of_map", "map", "intensity", cells, np.zeros(cells, int), start, free))
        self.blocks: tuple[Block, ...] = tuple(one for one in blocks if one.size)
        sizes = [one.size for one in self.blocks]
        self._ends = np.cumsum([0, *sizes])
        laws = np.cumsum([0, *(len(one.start) for one in self.blocks)])
        self._law = np.concatenate(
            [one.group + first for one, first in zip(self.blocks, laws, strict=False)] or [np.zeros(0, int)]
        )
        self.laws = tuple((one.name, row) for one in self.blocks for row in range(len(one.start)))
        self._free = np.array([one.free for one in self.blocks for _ in one.start], bool)
        least, of_map = dict.fromkeys(("objects", "objects_by_scan"), settings.least_objects), (settings.least_map_m,)
        least |= {"poses": settings.least_poses, "map": of_map}
        self._least = np.array([least.get(name, (settings.least_albedo,))[row] ** 2 for name, row in self.laws])
        self._fixed = {
            one.name: self._matrix(one) for one in self.blocks if one.name != "poses" and one.quantity == "range"
        }

    @property
    def has_poses(self) -> bool:
        """Whether poses have errors, and something is known of how large these are."""
        return any(one.name == "poses" and not one.free for one in self.blocks)

    @property
    def size(self) -> int:
        """How many random effects there are."""
        return int(self._ends[-1])

    @cached_property
    def independent_blocks(self) -> np.ndarray:
        """(m,) int blocks of random effects such that a beam depends on those of one block at most; −1 for poses.

        Range: all errors of one object, in all scans; map cells one by one. Reflectances one by one.
        """
        sample, found = self.sample, np.full(self.size, -1)
        things = sample.object_scan >= 0
        track_of_scan = np.zeros(int(sample.object_scan.max(initial=-1)) + 1, int)
        track_of_scan[sample.object_scan[things]] = self._track[things]
        tracks, first = int(self._track.max(initial=-1)) + 1, 0
        for name, unit in (
            ("objects", np.repeat(np.arange(tracks), 4)), ("objects_by_scan", np.repeat(track_of_scan, 4)),
        ):  # fmt: skip
            rows = self.rows(name)
            found[rows] = unit[: rows.stop - rows.start]
        first = tracks
        for name in ("map", "albedo", "albedo_of_map"):
            rows = self.rows(name)
            count = rows.stop - rows.start
            found[rows] = first + np.arange(count)
            first += count
        return found

    @cached_property
    def clusters(self) -> Clusters:
        """What beams and random effects share errors with."""
        sample = self.sample
        sectors = -(-self._settings.fewest_parts // max(len(sample.names), 1))
        sector = ((sample.azimuth + np.pi) / (2 * np.pi) * sectors).astype(int) % sectors
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
                of_unit[number[used]] = sample.track[used]
                track[rows] = np.repeat(of_unit, each)
        return Clusters(sample.track, sample.frame, sample.frame * sectors + sector, track, scan)

    def clusters_by_sector(self, sectors: int) -> Clusters:
        """The clusters with so many parts of each scan."""
        sample = self.sample
        sector = np.minimum(((sample.azimuth + np.pi) / (2 * np.pi) * sectors).astype(int), sectors - 1)
        return replace(self.clusters, part=sample.frame * sectors + sector)

    def start(self) -> Estimate:
        """None of anything, but pose errors of the spread that fits start from."""
        variance = np.array([value**2 for one in self.blocks for value in one.start])
        return Estimate(np.zeros(self.size), variance)

    def without(self, estimate: Estimate, names: Sequence[str]) -> Estimate:
        """To start from, with no random effects of some kinds."""
        gone = np.array([name in names for name, _ in self.laws])
        return Estimate(np.zeros(self.size), np.where(gone, 0.0, estimate.variance))

    def begun_from(self, other: RandomEffects | None, estimate: Estimate | None) -> Estimate:
        """To start from what another sample of the same drive told; from nothing where that has none."""
        if other is None or estimate is None or other.laws != self.laws:
            return self.start()
        return Estimate(self._told(other, estimate, 0), estimate.variance)

    def transferred(self, other: RandomEffects, estimate: Estimate, scan: int) -> Estimate:
        """The random effects of a sample of one scan, as they were estimated from another sample with that scan.

        Args:
            other, estimate: of the other sample.
            scan: its row there.
        """
        known = np.where(estimate.variance[: len(self.laws)] > 0, 1.0, 0.0)
        return Estimate(self._told(other, estimate, scan), known)

    def _told(self, other: RandomEffects, estimate: Estimate, scan: int) -> np.ndarray:
        """Random effects (m,) that another sample has, too, from row `scan` of its scans on; 0 elsewhere."""
        u = np.zeros(self.size)
        for block in self.blocks:
            theirs = estimate.u[other.rows(block.name)]
            if not len(theirs):
                continue
            known = {key: place for place, key in enumerate(other._keys(block.name, 0))}
            row = np.array([known.get(key, -1) for key in self._keys(block.name, scan)], int)
            mine = u[self.rows(block.name)].reshape(len(row), -1)
            mine[row >= 0] = theirs.reshape(len(known), -1)[row[row >= 0]]
        return u

    def _keys(self, name: str, scan: int) -> list[tuple]:
        """What each unit of one kind is: a scan from `scan` on, or a track's name with its scan, or with a facing."""
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
        """Where the random effects of one kind stand; empty where there are none."""
        places = (slice(int(a), int(b)) for a, b in pairwise(self._ends))
        return next((rows for one, rows in zip(self.blocks, places, strict=True) if one.name == name), slice(0, 0))

    def _each(self, values: np.ndarray) -> Iterator[tuple[Block, np.ndarray]]:
        """Each block with its part of values (m,)."""
        for one, (start, end) in zip(self.blocks, pairwise(self._ends), strict=True):
            yield one, values[start:end]

    def of_part(self, parts: Sequence[str]) -> np.ndarray:
        """(m,) bool: which belong to some parts of the budget."""
        found = np.zeros(self.size, bool)
        for one, mine in self._each(found):
            mine[:] = one.part in parts
        return found

    def poses(self, estimate: Estimate) -> np.ndarray:
        """(scans, 6) pose errors; 0 where poses have none."""
        found = estimate.u[self.rows("poses")].reshape(-1, _AXES)
        return found if len(found) else np.zeros((len(self.sample.names), _AXES))

    def spread(self, estimate: Estimate, name: str) -> np.ndarray:
        """Standard deviations of one kind, by law, 0 where nothing is known of them; empty where there are none."""
        variance = np.where(self._free, 0.0, estimate.variance)
        return np.sqrt([v for (of, _), v in zip(self.laws, variance, strict=True) if of == name])

    def precision(self, estimate: Estimate) -> np.ndarray:
        """(m,) inverse variances; those of laws without variance are as good as infinite."""
        return 1 / np.maximum(estimate.variance, 1e-30)[self._law]

    def active(self, estimate: Estimate) -> np.ndarray:
        """(m,) bool: those that may be other than 0."""
        return (estimate.variance > 0)[self._law]

    def adjusted(self, expected: Prediction, estimate: Estimate) -> Prediction:
        """A prediction as the random effects change it."""
        moved = self._pose_errors.shift(self.poses(estimate), expected.range_m)
        for one, part in self._each(estimate.u):
            if one.name != "poses" and one.quantity == "range" and part.any():
                moved = moved + self._fixed[one.name] @ part
        share = self.brightness(estimate)
        spread = expected.intensity_sigma * (share if self.sample.of_own_map else 1.0)
        return replace(
            expected, range_m=expected.range_m + moved, intensity=expected.intensity * share, intensity_sigma=spread
        )

    def brightness(self, estimate: Estimate) -> np.ndarray:
        """Factor (n,) by which random effects change intensities."""
        bright = np.zeros(len(self.sample))
        for one, part in self._each(estimate.u):
            if one.quantity == "intensity" and part.any():
                bright = bright + self._hot(one) @ part
        return np.maximum(1 + bright, self._settings.darkest)

    def passed_on(self, expected: Prediction, estimate: Estimate) -> dict[Quantity, np.ndarray]:
        """Factors (n,) by which changes of what effects predict come out beside the random effects as they are.

        Far ground at a flat angle moves by another length where the pose is off; brightness is near one but where
        reflectances are free.
        """
        found: dict[Quantity, np.ndarray] = {"range": self._pose_errors.onward(self.poses(estimate), expected.range_m)}
        if self.sample.of_own_map:
            found["intensity"] = self.brightness(estimate)
        return found

    def designs(self, expected: Prediction, estimate: Estimate) -> dict[Quantity, SparseMatrix]:
        """Derivatives (n, m) of each quantity that they change; of active ones alone, other columns are empty."""
        rows, active = len(self.sample), self.active(estimate)
        parts: dict[Quantity, list[SparseMatrix]] = {"range": [], "intensity": [], "intensity_variance": []}
        for (one, mine), (_, u) in zip(self._each(active), self._each(estimate.u), strict=True):
            empty = sparse.csr_matrix((rows, one.size))
            if not mine.any():
                found = empty
            elif one.name == "poses":
                found = self._pose_errors.slopes(self.poses(estimate), expected.range_m)
            elif one.quantity == "range":
                found = self._fixed[one.name]
            else:
                found = self._light(one, expected)
            of_spread = self._of_spread(one, u) if one.free else empty
            for quantity, columns in parts.items():
                other = of_spread if quantity == "intensity_variance" and one.quantity == "intensity" else empty
                columns.append(found if quantity == one.quantity else other)
        return {name: sparse.hstack(columns, format="csr") for name, columns in parts.items() if columns}

    def informed(self, expected: Prediction, evidence: Evidence) -> np.ndarray:
        """(m,) information of beams on each random effect, as if others were known."""
        found = np.zeros(self.size)
        everything = Estimate(np.zeros(self.size), np.ones(len(self.laws)))
        for name, design in self.designs(expected, everything).items():
            if name in evidence.information:
                found += design.multiply(design).T @ evidence.information[name]
        return found

    def updated(self, estimate: Estimate, solver: Factored | None) -> Estimate:
        """Variances after one update: MacKay's fixed point (Neural Comput. 1992), traces by random probes.

        Args:
            estimate: with predictions at the present variances.
            solver: of the information of the active random effects, their laws included.
        """
        used, variance = np.flatnonzero(self.active(estimate)), estimate.variance.copy()
        if solver is None:
            return estimate
        precision, law = self.precision(estimate)[used], self._law[used]
        signs = np.random.default_rng(0).choice((-1.0, 1.0), (len(used), self._settings.probes))
        unsure = (signs * solver.solve(signs)).mean(1)
        told = np.bincount(law, 1 - precision * unsure, len(variance))
        size = np.bincount(law, estimate.u[used] ** 2, len(variance))
        mine, most = np.unique(law), self._settings.most_step
        new = size[mine] / np.maximum(told[mine], 0.5)
        variance[mine] = np.clip(new, variance[mine] / most, variance[mine] * most)
        poses = np.array([name == "poses" for name, _ in self.laws])
        variance = np.where(poses, np.maximum(variance, self._least), variance)
        variance = np.where(self._free, estimate.variance, variance)
        gone = (variance < self._least) & ~poses
        return Estimate(np.where(gone[self._law], 0.0, estimate.u), np.where(gone, 0.0, variance))

    def begun(self, estimate: Estimate, expected: Prediction, evidence: Evidence) -> Estimate:
        """With the variances of laws that are at 0 and should not be, by the method of moments.

        What beams of one unit share shows as the square of their summed scores beyond the sum of their squares.

        Args:
            estimate, expected, evidence: of the fit.
        """
        variance = estimate.variance.copy()
        begun = dict[str, bool]()
        for place, one in enumerate(self.blocks):
            idle = [k for k, (name, _) in enumerate(self.laws) if name == one.name and variance[k] <= 0]
            if not idle or one.quantity not in evidence.score or begun.get(one.name.split("_by")[0]):
                continue
            matrix = self._fixed[one.name] if one.quantity == "range" else self._light(one, expected)
            shared = matrix.T @ evidence.score[one.quantity]
            square = matrix.multiply(matrix)
            own = square.T @ evidence.score[one.quantity] ** 2
            known = square.T @ evidence.information[one.quantity]
            law = self._law[self._ends[place] : self._ends[place + 1]]
            for k in idle:
                mine = law == k
                excess, total = float((shared[mine] ** 2 - own[mine]).sum()), float((known[mine] ** 2).sum())
                if excess > self._settings.variance_sigmas * np.sqrt(2 * float((own[mine] ** 2).sum())) and total > 0:
                    variance[k] = max(excess / total, 4 * self._least[k])
                    begun[one.name] = True  # what changes from scan to scan is asked once what stays is known
        return replace(estimate, variance=variance)

    def _light(self, block: Block, expected: Prediction) -> SparseMatrix:
        return sparse.diags(expected.intensity) @ self._hot(block)

    def _of_spread(self, block: Block, u: np.ndarray) -> SparseMatrix:
        """Derivatives (n, size) of the log spread of intensities, which are noisier the brighter a surface is."""
        if block.quantity != "intensity":
            return sparse.csr_matrix((len(self.sample), block.size))
        return self._hot(block) @ sparse.diags(1 / np.maximum(1 + u, self._settings.darkest))

    def _matrix(self, block: Block) -> SparseMatrix:
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

    def _hot(self, block: Block) -> SparseMatrix:
        if block.name not in self._fixed:
            number = self._track if block.name == "albedo" else self.sample.surface
            used = np.flatnonzero(number >= 0)
            ones = np.ones(len(used))
            self._fixed[block.name] = sparse.csr_matrix((ones, (used, number[used])), (len(number), block.size))
        return self._fixed[block.name]
