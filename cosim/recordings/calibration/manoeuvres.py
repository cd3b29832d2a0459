"""Expected information of candidate drives about parameters that a recording leaves undetermined.

A candidate is traced in a simple world of rectangles with the sensor's own beams and effects. Slopes of ranges and
intensities by every parameter are projected on what poses of scans and places and reflectances of surfaces cannot take
up, as a fit does; what is left is the information of the parameter. The path of the recording is traced in the same
world, so that a candidate is compared with it under equal conditions.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial.transform import Rotation

from assets.materials import TABLE
from cosim.discrepancy.candidates import candidate_effects, confusable, weak_forms
from cosim.discrepancy.settings import DEFAULT
from cosim.recordings.mapping.motion import motions
from sensors.beams import Beams
from sensors.effects.acting import Streams, act_on_beams, in_order
from sensors.effects.base import Effect
from sensors.effects.expectation import Expectation, expect
from sensors.effects.registry import effect_classes
from sensors.hits import NOTHING, STATIC, Hits, Surface
from sensors.normals import encode_normals
from sensors.pattern import Pattern
from sensors.rays import Rays
from sensors.shot import Shot
from sensors.world import Traced

_SCANS, _EVERY = 12, 3  # scans of a candidate, and sweeps from one to the next
_BEAMS = 2500  # of a scan
_CELL_M = 2.0
_GRAZING = 0.05
_STEEPEST_M_PER_RAD = DEFAULT.likelihood.steepest_m_per_rad
_NO_SLOPE = 1e-9
_ALONE = 1e-6  # share of a parameter's information that remains with nuisances, below which it is not identifiable

Form = tuple[tuple[Effect, ...], float, str, str]
"""The model with an effect a little stronger, by how much, the effect's name and the parameter."""


@dataclass(frozen=True)
class Rectangle:
    """A flat surface.

    Attributes:
        centre: [m].
        along, up: half its sides [m], at right angles.
    """

    centre: tuple[float, float, float]
    along: tuple[float, float, float]
    up: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Manoeuvre:
    """A candidate drive.

    Attributes:
        words: what to do.
        poses: (n, 4, 4) of the sensor, one sweep after the other; each second one is traced.
        world: surfaces.
    """

    words: str
    poses: np.ndarray
    world: tuple[Rectangle, ...]


def street(height_m: float) -> tuple[Rectangle, ...]:
    """Level ground, house fronts at 10 m and 40 m, one across at each end."""
    long, tall = (70.0, 0.0, 0.0), (0.0, 0.0, 5.0)
    return (
        Rectangle((0, 0, -height_m), (90, 0, 0), (0, 60, 0)),
        Rectangle((0, 10, 5 - height_m), long, tall),
        Rectangle((0, -40, 5 - height_m), long, tall),
        Rectangle((60, 0, 5 - height_m), (0, 40, 0), tall),
        Rectangle((-60, -10, 5 - height_m), (0, 30, 0), tall),
    )


def hill(height_m: float, grade: float = 0.08) -> tuple[Rectangle, ...]:
    """The street with ground that rises from x = 0 on."""
    slope = Rectangle((30, 0, 30 * grade - height_m), (30, 0, 30 * grade), (0, 60, 0))
    return (slope, Rectangle((-45, 0, -height_m), (45, 0, 0), (0, 60, 0)), *street(height_m)[1:])


def candidates(height_m: float, sweep_s: float) -> tuple[Manoeuvre, ...]:
    """Drives that anybody can make.

    Args:
        height_m: of the sensor above the ground.
        sweep_s: duration of a turn.
    """
    count = _SCANS * _EVERY
    flat = street(height_m)
    time = np.arange(count) * sweep_s
    steady = 8.0 * time - 4.0 * time[-1]
    braking = np.clip(14.0 * time - 0.5 * 4.5 * time**2, None, 14.0**2 / 9.0)
    braking[np.argmax(braking) :] = braking.max()
    half = count // 2
    near, far = np.full(half, 5.0), np.full(count - half, -25.0)
    passes = _along(np.tile(8.0 * time[:half] - 4.0 * time[half], 2)[:count], np.concatenate([near, far]))
    turn = np.linspace(0, 2 * np.pi, count)
    climb = steady
    bump = np.where(climb > 0, -np.arctan(0.08) * np.clip(climb / 3, 0, 1), 0.0)
    return (
        Manoeuvre("drive straight at one speed", _along(steady), flat),
        Manoeuvre("brake once from 50 km/h to a stop", _along(braking - braking.mean()), flat),
        Manoeuvre("drive past the same walls at 10 m and at 40 m", passes, flat),
        Manoeuvre("turn a full circle, as small as the vehicle can", _circle(turn, 6.0), flat),
        Manoeuvre(
            "drive onto a ramp or a hill of 8 %",
            _along(climb, z=np.clip(climb, 0, None) * 0.08, pitch=bump),
            hill(height_m),
        ),
        Manoeuvre("drive head-on towards a wall, from 60 m to 10 m", _along(np.linspace(0, 50, count)), flat),
    )


def standard_errors(
    manoeuvre: Manoeuvre, pattern: Pattern, effects: Sequence[Effect], names: Collection[str]
) -> dict[tuple[str, str], float]:
    """Expected standard error of parameters, by effect and name; infinite if not identifiable.

    Each is fitted together with the parameters of the effects that it can be confused with.

    Args:
        manoeuvre: the drive.
        pattern: of the beams.
        effects: of the sensor.
        names: names of the effects.
    """
    rays = _thinned(pattern)
    effects = in_order(effects)
    forms = _forms(effects, pattern, names)
    table = _Table(len(forms))
    steps = motions(manoeuvre.poses)
    for turn, number in enumerate(range(0, len(manoeuvre.poses), _EVERY)):
        scan = _Scan.of(manoeuvre, number, steps[number], rays, pattern, effects)
        table.add(turn, scan, [scan.slope(form, step) for form, step, *_ in forms])
    share = len(pattern.rays()) / len(rays)
    errors = table.errors([_rivals(form[2], forms) for form in forms]) / np.sqrt(share)
    found: dict[tuple[str, str], float] = {}
    for (_, _, name, amplitude), error in zip(forms, errors, strict=True):
        if name in names:
            found[name, amplitude] = min(float(error), found.get((name, amplitude), np.inf))
    return found


def _rivals(name: str, forms: Sequence[Form]) -> list[int]:
    """Rows of the parameters of the effects that an effect can be mistaken for."""
    types = effect_classes()
    return [row for row, form in enumerate(forms) if form[2] != name and confusable(types[name], types[form[2]])]


def same_path(poses: np.ndarray, height_m: float) -> Manoeuvre:
    """The middle of a path, in the street."""
    count = min(len(poses), _SCANS * _EVERY)
    first = (len(poses) - count) // 2
    part = poses[first : first + count]
    own = np.linalg.inv(part[count // 2]) @ part
    return Manoeuvre("this drive", own, street(height_m))


def _forms(effects: Sequence[Effect], pattern: Pattern, names: Collection[str]) -> list[Form]:
    """The model with each of some effects, or of those that they can be mistaken for, a little stronger."""
    found, types = [], effect_classes()
    for kind in candidate_effects(rings=pattern.rings):
        if kind.by_search or kind.neutral is None or kind.name not in types:
            continue
        if kind.name not in names and not any(confusable(types[kind.name], types[name]) for name in names):
            continue
        for weak, amplitude, step in weak_forms(kind):
            if not amplitude or np.ndim(getattr(weak, amplitude)):
                continue  # values per laser follow from differences between lasers on one surface, in any drive
            own = next((one for one in effects if one.name == kind.name), None)
            if own is not None:
                weak = type(own).model_validate({**own.model_dump(), amplitude: getattr(own, amplitude) + step})
            others = [one for one in effects if one.name != kind.name]
            found.append((in_order([*others, weak]), step, kind.name, amplitude))
    return found


def _along(
    x: np.ndarray, y: np.ndarray | float = 0.0, z: np.ndarray | float = 0.0, pitch: np.ndarray | float = 0.0
) -> np.ndarray:
    poses = np.tile(np.eye(4), (len(x), 1, 1))
    poses[:, 0, 3], poses[:, 1, 3], poses[:, 2, 3] = x, y, z
    poses[:, :3, :3] = Rotation.from_rotvec(np.broadcast_to(pitch, len(x))[:, None] * [0.0, 1.0, 0.0]).as_matrix()
    return poses


def _circle(turn: np.ndarray, radius_m: float) -> np.ndarray:
    poses = _along(radius_m * np.sin(turn), -10 + radius_m * (1 - np.cos(turn)))
    poses[:, :3, :3] = Rotation.from_rotvec(turn[:, None] * [0.0, 0.0, 1.0]).as_matrix()
    return poses


def _thinned(pattern: Pattern) -> Rays:
    """Some beams, all lasers, evenly around."""
    rays = pattern.rays()
    step = max(1, len(rays) // _BEAMS)
    rows = np.concatenate(
        [np.arange(ring, pattern.firings, step) + ring * pattern.firings for ring in range(pattern.rings)]
    )
    rows = rows[rows < len(rays)]
    return Rays(**{name: values[rows] for name, values in vars(rays).items() if isinstance(values, np.ndarray)})


@dataclass(frozen=True, eq=False)
class _Scan:
    """One scan of a candidate: which surface each beam met, what the model expects, and slopes by nuisances."""

    rays: Rays
    pattern: Pattern
    pose: np.ndarray
    step: np.ndarray
    plane: np.ndarray
    offset: np.ndarray
    normal: np.ndarray
    expected: Expectation
    used: np.ndarray
    cell: np.ndarray
    by_pose: np.ndarray
    by_place: np.ndarray

    @classmethod
    def of(
        cls,
        manoeuvre: Manoeuvre,
        number: int,
        step: np.ndarray,
        rays: Rays,
        pattern: Pattern,
        effects: Sequence[Effect],
    ) -> _Scan:
        """Trace a scan, and keep which surface each beam meets."""
        pose = manoeuvre.poses[number]
        origin, direction = _world_beams(effects, rays, pattern, pose, step)
        plane, range_m = _met(manoeuvre.world, origin, direction, pattern.range_m)
        normals, offsets = _planes(manoeuvre.world)
        row = np.maximum(plane, 0)
        normal, offset = normals[row], offsets[row]
        met = origin + direction * np.where(plane >= 0, range_m, 0)[:, None]
        slant = np.einsum("ij,ij->i", normal, direction)
        used = (plane >= 0) & (np.abs(slant) > _GRAZING)
        safe = np.where(used, slant, 1.0)
        by_pose = np.concatenate([-normal / safe[:, None], -np.cross(met - pose[:3, 3], normal) / safe[:, None]], 1)
        cells = np.floor(met / _CELL_M).astype(int) @ np.array([1, 1 << 16, 1 << 32]) * 16 + row
        scan = cls(rays, pattern, pose, step, plane, offset, normal, None, used, cells, by_pose, 1 / safe)  # type: ignore[arg-type]
        expected = scan.expect(effects)
        return cls(
            rays, pattern, pose, step, plane, offset, normal, expected,
            used & np.isfinite(expected.range_m) & (expected.intensity > 0), cells, by_pose, 1 / safe,
        )  # fmt: skip

    def expect(self, effects: Sequence[Effect]) -> Expectation:
        """Prediction of effects if each beam still hits the plane that it hit."""
        origin, direction = _world_beams(effects, self.rays, self.pattern, self.pose, self.step)
        slant = np.einsum("ij,ij->i", self.normal, direction)
        slant = np.where(np.abs(slant) < 1e-3, 1e-3, slant)
        range_m = (self.offset - np.einsum("ij,ij->i", self.normal, origin)) / slant
        there = (self.plane >= 0) & (range_m > 0)
        solid = Surface(
            np.where(there, range_m, np.inf).astype(np.float32),
            encode_normals(self.normal),
            np.full(len(range_m), _MATERIAL, np.uint8),
            np.where(there, STATIC, NOTHING).astype(np.int16),
        )
        none = np.zeros(0, np.int32)
        hits = Hits(self.rays, self.pose, solid, none, solid.take(none), np.zeros(0, np.float32))
        moving = ((origin - self.pose[:3, 3]).astype(np.float32), direction.astype(np.float32), self.rays.time_s)
        shot = Shot(self.pattern, self.rays, traced=Traced(hits, moving))
        found = expect(effects, shot)
        exact = np.where(there, range_m - np.where(there, solid.range_m, 0), 0.0)  # what single precision lost
        return Expectation(**{**vars(found), "range_m": found.range_m + exact})

    def slope(self, effects: Sequence[Effect], step: float) -> tuple[np.ndarray, np.ndarray]:
        """Change of ranges [m] and of the logarithm of intensities (n,) per unit of a parameter; 0 where unknown."""
        try:
            other = self.expect(effects)
        except (ValueError, AttributeError, TypeError):  # needs a scene, a camera or objects
            return np.zeros(len(self.rays)), np.zeros(len(self.rays))
        with np.errstate(divide="ignore", invalid="ignore"):
            light = np.log(other.intensity) - np.log(self.expected.intensity)
        ranges = np.clip((other.range_m - self.expected.range_m) / step, -1e6, 1e6)
        return np.nan_to_num(ranges), np.nan_to_num(light / step, posinf=0, neginf=0)


class _Table:
    """Normal equations of parameters, poses, and places and reflectances of cells.

    Args:
        count: of parameters.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._parts: list[tuple[sparse.csr_matrix, np.ndarray, np.ndarray, np.ndarray]] = []

    def add(self, turn: int, scan: _Scan, slopes: Sequence[tuple[np.ndarray, np.ndarray]]) -> None:
        """The beams of one scan."""
        rows = np.flatnonzero(scan.used)
        by_pose = np.zeros((len(rows), 6 * _SCANS))
        by_pose[:, 6 * turn : 6 * turn + 6] = scan.by_pose[rows]
        ranges = np.stack([one[0][rows] for one in slopes], 1)
        lights = np.stack([one[1][rows] for one in slopes], 1)
        sigma = np.maximum(scan.expected.range_sigma_m[rows], 0.005)
        share = np.maximum(scan.expected.intensity_sigma[rows] / scan.expected.intensity[rows], 0.03)
        for kind, pose, slope, along, spread in (
            (0, by_pose, ranges, scan.by_place[rows], sigma),
            (1, np.zeros_like(by_pose), lights, np.ones(len(rows)), share),
        ):
            columns = sparse.csr_matrix(np.concatenate([pose, slope], 1))
            self._parts.append((columns, along, 2 * scan.cell[rows] + kind, 1 / spread**2))

    def errors(self, rivals: Sequence[Sequence[int]]) -> np.ndarray:
        """(k,) standard errors of the parameters, each fitted with the nuisances and some others, by row."""
        columns = sparse.vstack([part[0] for part in self._parts]).tocsr()
        along, weight = (
            np.concatenate(parts) for parts in ([part[1] for part in self._parts], [part[3] for part in self._parts])
        )
        _, cell = np.unique(np.concatenate([part[2] for part in self._parts]), return_inverse=True)
        weighted = sparse.diags(weight) @ columns
        own = (columns.T @ weighted).toarray()
        basis = sparse.csr_matrix((along, (np.arange(len(cell)), cell)))
        across = (weighted.T @ basis).toarray()
        of_cells = np.bincount(cell, weight * along**2) + 1 / DEFAULT.random_effects.free_map_m**2
        own -= (across / of_cells) @ across.T
        poses = 6 * _SCANS
        prior = np.tile(1 / np.square(DEFAULT.random_effects.free_poses), _SCANS)
        inner = own[:poses, :poses] + np.diag(prior)
        outer = own[:poses, poses:]
        between = own[poses:, poses:] - outer.T @ np.linalg.solve(inner, outer)
        whole = np.asarray(columns.multiply(weighted).sum(0)).ravel()[poses:]
        left = np.diag(between).copy()
        for row, beside in enumerate(rivals):
            others = [other for other in beside if left[other] > _ALONE * max(whole[other], _NO_SLOPE)]
            part = between[np.ix_(others, others)]
            left[row] -= between[row, others] @ np.linalg.pinv(part, hermitian=True, rcond=1e-9) @ between[others, row]
        tells = (whole > _NO_SLOPE) & (left > _ALONE * whole)
        return np.where(tells, 1 / np.sqrt(np.where(tells, left, 1.0)), np.inf)


def _world_beams(
    effects: Sequence[Effect], rays: Rays, pattern: Pattern, pose: np.ndarray, step: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions (n, 3) of the true beams in world axes, the sensor moving by `step` (6,) in a sweep."""
    beams = act_on_beams(effects, Beams.nominal(rays), Shot(pattern, rays), Streams(np.random.default_rng(0)), "drive")
    origin, direction = (values.astype(float) @ beams.mount[:3, :3].T for values in (beams.origin, beams.direction))
    origin = origin + beams.mount[:3, 3]
    if beams.firing_s is not None:
        share = beams.firing_s.astype(float)[:, None] / pattern.sweep_s
        turn = Rotation.from_rotvec(share * step[:3])
        origin, direction = turn.apply(origin) + share * step[3:], turn.apply(direction)
    return origin @ pose[:3, :3].T + pose[:3, 3], direction @ pose[:3, :3].T


def _planes(world: Sequence[Rectangle]) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals (p, 3) and distances (p,) from the origin."""
    normal = np.array([np.cross(one.along, one.up) for one in world], float)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return normal, np.einsum("ij,ij->i", normal, np.array([one.centre for one in world], float))


def _met(
    world: Sequence[Rectangle], origin: np.ndarray, direction: np.ndarray, reach: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Row of the rectangle that each beam meets first (n,), −1 for none, and its range."""
    best, plane = np.full(len(origin), np.inf), np.full(len(origin), -1)
    normals, offsets = _planes(world)
    for row, one in enumerate(world):
        slant = direction @ normals[row]
        with np.errstate(divide="ignore", invalid="ignore"):
            range_m = (offsets[row] - origin @ normals[row]) / slant
        met = origin + direction * np.nan_to_num(range_m, posinf=0, neginf=0)[:, None] - np.array(one.centre)
        within = np.ones(len(origin), bool)
        for side in (np.array(one.along), np.array(one.up)):
            within &= np.abs(met @ side) <= side @ side
        nearer = within & (range_m > reach[0]) & (range_m < min(reach[1], best.max())) & (range_m < best)
        best[nearer], plane[nearer] = range_m[nearer], row
    return plane, best


_MATERIAL = int(np.abs(TABLE.column("reflectance") - 0.3).argmin())
