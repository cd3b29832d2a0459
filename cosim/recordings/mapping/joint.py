"""Joint adjustment: parameters of the sensor, poses of scans and places of surfaces, from all points at once.

Points are corrected by effects that move them (`Correction`), so that their slopes by a parameter are known. Poses and
parameters are unknowns of one least-squares problem whose surfaces are eliminated (as in `adjust`); surfaces are made
anew after every step, so that a map of wrong points cannot hold a parameter back. Candidates are tested by their score
with everything else eliminated; intervals and tests are robust to errors that points of one place share (White 1980, by
squares of the ground). Related: Levinson and Thrun, ISER 2010.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg, sparse, stats

from cosim.discrepancy.candidates import Unknown, amplitudes, unknowns, weak_forms, with_values
from cosim.discrepancy.data.checks import undetermined_effects
from cosim.drives.twin.surfels import cell_keys
from cosim.recordings.mapping.adjust import OUTLIER_M
from cosim.recordings.mapping.correction import Correction, moves_points
from cosim.recordings.mapping.motion import applied, deskewed, motions, nudged, scan_times
from cosim.recordings.mapping.odometry import Trajectory
from cosim.recordings.mapping.scans import LocalScan, cloud_of, in_turn, thinned
from cosim.recordings.mapping.surfels import Surfels, SurfelSettings, make_surfels
from cosim.recordings.recording import Recording
from cosim.recordings.scan import Scan
from sensors.effects.base import Effect
from sensors.effects.beams.sweep_motion import SweepMotion
from sensors.effects.lasers import for_rings
from sensors.effects.registry import effect_classes

_SCANS, _POINTS = 60, 10_000  # of the recording, that are adjusted, and points of each
_NEAREST_M, _FARTHEST_M = 2.0, 60.0
_HUBER_M = 0.03
_PRIOR = np.array([1e3, 1e3, 1e3, 1e2, 1e2, 1e2])  # holds what no surface holds
_HELD = 1e12
_FIRST_STEPS, _STEPS = 5, 8
_MOST = 3  # effects that are added
_SQUARE_M = 8.0  # of the ground, whose points share errors
_LEVEL = 0.01
_LEAST_LEFT = 1e-3  # share of a candidate's information that poses and surfaces leave
_LIST_PRIOR = 0.5  # numbers of a list, relative to their natural size: what all lasers share is not told
_CHUNK = 4096
_PLANE_PRIOR = np.array([1e-6, 1e-3, 1e-3])  # holds tilts that no point holds
_THICKEST_M = 0.1


@dataclass(frozen=True)
class JointFinding:
    """A parameter of the sensor, from the joint adjustment.

    Attributes:
        effect, parameter: which.
        value, low, high: with the 95 % interval; tuples with a number a laser.
        p_value: family-wise over the candidates of its step (Bonferroni).
    """

    effect: str
    parameter: str
    value: float | tuple[float, ...]
    low: float | tuple[float, ...]
    high: float | tuple[float, ...]
    p_value: float


@dataclass(frozen=True, eq=False)
class JointResult:
    """What the joint adjustment gave.

    Attributes:
        findings: parameters that are significant, in order.
        tested: effect and parameter, z of the score and p of every candidate beside the findings.
        effects: of the sensor, with the findings.
    """

    findings: tuple[JointFinding, ...]
    tested: tuple[tuple[str, str, float, float], ...]
    effects: tuple[Effect, ...]


@dataclass(frozen=True, eq=False)
class _Parameter:
    """One unknown of the sensor, or a list: which effect it belongs to, and how points change with it."""

    effect: Effect
    unknown: Unknown
    size: int

    @property
    def name(self) -> tuple[str, str]:
        return self.effect.name, self.unknown.name


@dataclass(frozen=True, eq=False)
class _Part:
    """Points of one scan on surfaces.

    Attributes:
        row: (n,) surfaces.
        weight: (n,) Huber's.
        off: (n,) distances from the surface [m].
        slope: (n, 6) by turn and shift of the pose.
        columns: (n, k) by parameters, a block for each.
        plane: (n, 3) by the surface's shift and tilts.
        square: (n,) int of the ground.
    """

    row: np.ndarray
    weight: np.ndarray
    off: np.ndarray
    slope: np.ndarray
    columns: np.ndarray
    plane: np.ndarray
    square: np.ndarray


class _Problem:
    """The recording, thinned, with effects and poses as they stand."""

    def __init__(
        self,
        recording: Recording,
        path: Trajectory,
        correction: Correction,
        scale: float,
        on_scan: Callable[[], object],
    ) -> None:
        count = len(recording)
        first = max((count - _SCANS) // 2, 0)
        chosen = range(first, min(first + _SCANS, count))
        self.pattern, self.correction = correction.pattern, correction
        self.scans = [_thinned(recording[number], number) for number in chosen]
        for _ in chosen:
            on_scan()
        self.poses = path.poses[chosen.start : chosen.stop].copy()
        self.turns = path.turns[chosen.start : chosen.stop]
        self.effects = tuple(one for one in correction.effects if not isinstance(one, SweepMotion))
        self.scale = scale
        self.settings = replace(SurfelSettings(), thickest_m=_THICKEST_M)
        self.share = [
            scan_times(scan.azimuth_rad, scan.time_s, self.pattern.sweep_s) / self.pattern.sweep_s
            for scan in self.scans
        ]

    @property
    def motion(self) -> np.ndarray:
        return motions(self.poses, self.turns)

    def points(self, effects: Sequence[Effect]) -> Iterator[np.ndarray]:
        """Points (n, 3) of each scan with effects undone, in its own axes, at their own times."""
        correction = replace(self.correction, effects=tuple(effects))
        for scan in self.scans:
            yield correction.undone(scan).xyz if correction.is_needed else scan.xyz

    def surfels(self, xyz: Sequence[np.ndarray]) -> Surfels:
        """The map of points as they stand."""
        local = [
            LocalScan(own.astype(np.float32), share.astype(np.float32), np.zeros(len(own), np.float32))
            for own, share in zip(xyz, self.share, strict=True)
        ]
        cloud = cloud_of(local, self.poses, self.scale * self.motion, range(len(local)))
        return make_surfels(cloud, self.settings)[0]

    def parts(self, parameters: Sequence[_Parameter], surfels: Surfels, xyz: Sequence[np.ndarray]) -> list[_Part]:
        """Points on surfaces, with slopes by poses and parameters."""
        motion = self.motion
        across = _in_plane(surfels.normal)
        moved = [self._slopes(parameter, xyz) for parameter in parameters]
        found = []
        for number, own in enumerate(xyz):
            share, pose = self.share[number], self.poses[number]
            world = applied(pose, deskewed(own, share, self.scale * motion[number]))
            row = surfels.rows_of(cell_keys(world, self.settings.cell_m))
            on = np.flatnonzero(row >= 0)
            row, world = row[on], world[on]
            normal = surfels.normal[row]
            off = np.einsum("ij,ij->i", world - surfels.centre[row], normal)
            near = np.abs(off) < OUTLIER_M
            on, row, world, normal, off = on[near], row[near], world[near], normal[near], off[near]
            weight = np.minimum(1.0, _HUBER_M / np.maximum(np.abs(off), 1e-9))
            slope = np.concatenate([np.cross(world - pose[:3, 3], normal), normal], 1)
            blocks = []
            ring = self._rings(number)[on]
            for parameter, changes in zip(parameters, moved, strict=True):
                if parameter.effect.name == SweepMotion.name:
                    change = deskewed(own, share, (self.scale + 0.01) * motion[number])
                    change = (change - deskewed(own, share, self.scale * motion[number]))[on] / 0.01
                else:
                    change = changes[number][on]
                along = np.einsum("ij,ij->i", change @ pose[:3, :3].T, normal)
                if parameter.size > 1:
                    block = np.zeros((len(on), parameter.size))
                    known = ring >= 0
                    block[np.flatnonzero(known), ring[known]] = along[known]
                else:
                    block = along[:, None]
                blocks.append(block)
            beside = world - surfels.centre[row]
            plane = np.stack([np.ones(len(row)), *(np.einsum("ij,ij->i", beside, axis[row]) for axis in across)], 1)
            square = np.floor(world[:, :2] / _SQUARE_M).astype(np.int64) @ np.array([1, 1 << 20])
            columns = np.concatenate(blocks, 1) if blocks else np.zeros((len(on), 0))
            found.append(_Part(row, weight, off, slope, columns, plane, square))
        return found

    def _slopes(self, parameter: _Parameter, xyz: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Change (n, 3) of each scan's points per unit of a parameter, of all numbers of a list alike."""
        if parameter.effect.name == SweepMotion.name:
            return []
        effect, step = parameter.effect, parameter.unknown.step
        value = np.asarray(getattr(effect, parameter.unknown.name), float)
        stronger = with_values(effect, {parameter.unknown.name: value + step})
        others = [one for one in self.effects if one.name != effect.name]
        return [(new - old) / step for new, old in zip(self.points([*others, stronger]), xyz, strict=True)]

    def _rings(self, number: int) -> np.ndarray:
        from cosim.recordings.pattern.find import beams_of

        which = beams_of(self.scans[number], self.correction.lines)
        return np.where(which >= 0, self.correction.ring_of[np.maximum(which, 0)], -1)


def adjust_jointly(
    recording: Recording,
    path: Trajectory,
    correction: Correction,
    scale: float,
    on_scan: Callable[[], object] = lambda: None,
) -> JointResult:
    """Find the effects that move points, and fit them together with poses and surfaces.

    Args:
        recording: scans in order.
        path: of the sensor.
        correction: of the sensor's effects as far as they are known.
        scale: share of the motion in a sweep that points are freed of; 0 where they were before.
        on_scan: called after each scan is read.
    """
    problem = _Problem(recording, path, correction, scale, on_scan)
    chosen = [_sweep_parameter(scale, correction.pattern.sweep_s)] if scale else []
    known = {one.name for one in problem.effects}
    for effect in problem.effects:
        chosen += [one for one in _parameters_of(effect, correction.pattern.rings) if moves_points(effect.name)]
    p_values = {one.name: 0.0 for one in chosen}
    _descend(problem, chosen, _FIRST_STEPS)
    tested: list[tuple[str, str, float, float]] = []
    for _ in range(_MOST + 1):
        candidates = [one for one in _candidates(problem, known) if one.name not in p_values]
        tested = _test(problem, chosen, candidates)
        if not tested or len(p_values) > _MOST + len(known) + 1:
            break
        best = min(tested, key=lambda row: (row[3], -row[2]))
        if best[3] > _LEVEL:
            break
        parameter = next(one for one in candidates if one.name == best[:2])
        chosen.append(parameter)
        p_values[parameter.name] = best[3]
        problem.effects = (*(one for one in problem.effects if one.name != parameter.effect.name), parameter.effect)
        chosen = _descend(problem, chosen, _STEPS)
    findings = _findings(problem, chosen, p_values)
    effects = tuple(problem.effects)
    if scale:
        effects = (*effects, SweepMotion(sweep_s=max(problem.scale * correction.pattern.sweep_s, 0.0)))
    return JointResult(findings, tuple(tested), effects)


def _thinned(scan: Scan, number: int) -> Scan:
    scan = in_turn(scan)
    reach = np.linalg.norm(scan.xyz, axis=1)
    rows = np.flatnonzero((reach > _NEAREST_M) & (reach < _FARTHEST_M))
    return scan[rows[thinned(len(rows), _POINTS)]]


def _sweep_parameter(scale: float, sweep_s: float) -> _Parameter:
    effect = SweepMotion(sweep_s=max(scale, 0.0) * sweep_s)
    return _Parameter(effect, unknowns(SweepMotion)[0], 1)


def _parameters_of(effect: Effect, rings: int) -> list[_Parameter]:
    """Amplitudes of an effect that can be fitted."""
    names = amplitudes(type(effect))
    return [
        _Parameter(effect, unknown, int(np.size(getattr(effect, unknown.name))))
        for unknown in unknowns(type(effect))
        if unknown.name in names
    ]


def _candidates(problem: _Problem, known: set[str]) -> list[_Parameter]:
    """Effects that move points by one number, or by one a laser, at nothing."""
    never, there = set(undetermined_effects(_SCANS, True)), {one.name for one in problem.effects} | known
    found, rings = [], problem.pattern.rings
    for kind in effect_classes().values():
        if not kind.is_candidate or kind.neutral is None or kind.by_search or kind.name in never | there:
            continue
        if not moves_points(kind.name) or kind is SweepMotion:
            continue
        kind = for_rings(kind, rings)
        forms = [form for form in weak_forms(kind) if form[1]]
        if len({form[1] for form in forms}) != 1 or len(forms) > 2:
            continue  # of several amplitudes or shapes: left to the diagnosis
        weak, amplitude, step = forms[0]
        value = np.asarray(getattr(weak, amplitude), float) - step
        unknown = next(one for one in unknowns(kind) if one.name == amplitude)
        size = int(np.size(value))
        if size in (1, rings):
            found.append(_Parameter(with_values(weak, {amplitude: value}), unknown, size))
    return found


@dataclass(frozen=True, eq=False)
class _Normal:
    """Normal equations of poses and parameters; places and tilts of surfaces eliminated.

    Attributes:
        matrix: (6 s + k, 6 s + k).
        right: (6 s + k,) the descent direction.
        white: (m, 3, 3) what makes shift and tilts of each surface independent, of one unit of information each.
        taken: (3 m, 6 s + k) sparse, what shifts and tilts take up of each slope; taken_off: (m, 3) and of distances.
        variance: of a point's distance.
    """

    matrix: np.ndarray
    right: np.ndarray
    white: np.ndarray
    taken: sparse.csr_matrix
    taken_off: np.ndarray
    variance: float

    def basis(self, part: _Part) -> np.ndarray:
        """(n, 3) by the independent changes of surfaces."""
        return np.einsum("nij,nj->ni", self.white[part.row], part.plane)


def _normal(parts: Sequence[_Part], size: int) -> _Normal:
    poses, count = 6 * len(parts), parts[0].columns.shape[1]
    total = poses + count
    gram = np.tile(np.diag(_PLANE_PRIOR), (size, 1, 1))
    for part in parts:
        for a in range(3):
            for b in range(3):
                gram[:, a, b] += np.bincount(part.row, part.weight * part.plane[:, a] * part.plane[:, b], size)
    white = np.linalg.inv(np.linalg.cholesky(gram))
    normal = _Normal(np.zeros((total, total)), np.zeros(total), white, sparse.csr_matrix((0, 0)), np.zeros(0), 0.0)
    matrix, right = normal.matrix, normal.right
    pulled, shared, own = np.zeros((size, 3)), [], np.zeros((3 * size, count))
    squared = points = 0.0
    for turn, part in enumerate(parts):
        mine = slice(6 * turn, 6 * turn + 6)
        weighted = part.slope * part.weight[:, None]
        columns = part.columns * part.weight[:, None]
        matrix[mine, mine] = weighted.T @ part.slope + np.diag(_PRIOR)
        matrix[mine, poses:] = weighted.T @ part.columns
        matrix[poses:, poses:] += columns.T @ part.columns
        right[mine] = -weighted.T @ part.off
        right[poses:] -= columns.T @ part.off
        basis = normal.basis(part)
        place = (3 * part.row[:, None] + np.arange(3)).ravel()
        of_points = sparse.csr_matrix(
            (basis.ravel(), place, np.arange(0, 3 * len(part.row) + 1, 3)), (len(part.row), 3 * size)
        )
        shared.append(sparse.csr_matrix(of_points.T @ weighted).T)
        own += of_points.T @ columns
        pulled += (of_points.T @ (part.weight * part.off)).reshape(size, 3)
        squared += float(part.weight @ part.off**2)
        points += len(part.row)
    matrix[poses:, :poses] = matrix[:poses, poses:].T
    across = sparse.vstack([*shared, sparse.csr_matrix(own.T)]).tocsc()
    right += across @ pulled.ravel()
    for start in range(0, 3 * size, _CHUNK):
        chunk = np.asarray(across[:, start : start + _CHUNK].todense())
        matrix -= chunk @ chunk.T
    matrix[:6, :6] += _HELD * np.eye(6)
    return replace(normal, taken=across.T.tocsr(), taken_off=pulled, variance=squared / max(points, 1.0))


def _in_plane(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors (m, 3) across each normal (m, 3)."""
    helper = np.where(np.abs(normal[:, 2:]) > 0.9, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    first = np.cross(normal, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return first, np.cross(normal, first)


def _ridged(normal: _Normal, parameters: Sequence[_Parameter], poses: int) -> np.ndarray:
    """The matrix with a weak prior on numbers of lists."""
    prior, at = np.zeros(len(normal.matrix)), poses
    for one in parameters:
        if one.size > 1:
            natural = _LIST_PRIOR * 50 * one.unknown.step  # a step is a fiftieth of the natural size
            prior[at : at + one.size] = normal.variance / natural**2 * 1e2
        at += one.size
    return normal.matrix + np.diag(prior)


def _descend(problem: _Problem, parameters: list[_Parameter], steps: int) -> list[_Parameter]:
    """Steps of poses and parameters, the map made anew before each; the parameters where they end."""
    for _ in range(steps):
        xyz = list(problem.points(problem.effects))
        surfels = problem.surfels(xyz)
        parts = problem.parts(parameters, surfels, xyz)
        normal = _normal(parts, len(surfels))
        poses = 6 * len(parts)
        change = linalg.solve(_ridged(normal, parameters, poses), normal.right, assume_a="pos")
        for number, step in enumerate(change[:poses].reshape(-1, 6)):
            problem.poses[number] = nudged(problem.poses[number], step)
        parameters = _moved(problem, parameters, change[poses:])
    return parameters


def _moved(problem: _Problem, parameters: Sequence[_Parameter], change: np.ndarray) -> list[_Parameter]:
    """Parameters after a step; effects and sweep of the problem follow."""
    found, at = [], 0
    effects = {one.name: one for one in problem.effects}
    for one in parameters:
        part = change[at : at + one.size]
        at += one.size
        if one.effect.name == SweepMotion.name:
            problem.scale = float(np.clip(problem.scale + part[0], 0.0, 3.0))
            found.append(_sweep_parameter(problem.scale, problem.pattern.sweep_s))
            continue
        effect = effects[one.effect.name]
        value = np.asarray(getattr(effect, one.unknown.name), float)
        effect = with_values(effect, {one.unknown.name: value + (part if value.ndim else part[0])})
        effects[effect.name] = effect
        found.append(replace(one, effect=effect))
    problem.effects = tuple(effects.values())
    return [replace(one, effect=effects.get(one.effect.name, one.effect)) for one in found]


def _by_square(parts: Sequence[_Part], normal: _Normal, direction: np.ndarray) -> np.ndarray:
    """Scores (c, d) of squares of the ground along directions (6 s + k, d) of all unknowns."""
    poses = 6 * len(parts)
    taken = (normal.taken @ direction).reshape(-1, 3, direction.shape[1])
    squares = np.unique(np.concatenate([part.square for part in parts]))
    found = np.zeros((len(squares), direction.shape[1]))
    for turn, part in enumerate(parts):
        along = part.slope @ direction[6 * turn : 6 * turn + 6] + part.columns @ direction[poses:]
        basis = normal.basis(part)
        along -= np.einsum("ni,nid->nd", basis, taken[part.row])
        left = part.off - np.einsum("ni,ni->n", basis, normal.taken_off[part.row])
        score = -(part.weight * left)[:, None] * along
        place = np.searchsorted(squares, part.square)
        for number in range(direction.shape[1]):
            found[:, number] += np.bincount(place, score[:, number], len(squares))
    return found


def _test(
    problem: _Problem, chosen: Sequence[_Parameter], candidates: Sequence[_Parameter]
) -> list[tuple[str, str, float, float]]:
    """Effect, parameter, z of the score and family-wise p of every candidate, everything chosen eliminated."""
    if not candidates:
        return []
    xyz = list(problem.points(problem.effects))
    surfels = problem.surfels(xyz)
    parts = problem.parts([*chosen, *candidates], surfels, xyz)
    normal = _normal(parts, len(surfels))
    matrix = _ridged(normal, [*chosen, *candidates], 6 * len(parts))
    fixed = 6 * len(parts) + sum(one.size for one in chosen)
    inner = linalg.cho_factor(matrix[:fixed, :fixed])
    found, at = [], fixed
    whole = sum((part.columns**2).T @ part.weight for part in parts)
    for one in candidates:
        mine = slice(at, at + one.size)
        at += one.size
        direction = np.zeros((len(matrix), one.size))
        direction[mine] = np.eye(one.size)
        direction[:fixed] = -linalg.cho_solve(inner, matrix[:fixed, mine])
        left = matrix[mine, mine] + matrix[mine, :fixed] @ direction[:fixed]
        own = whole[mine.start - 6 * len(parts) : mine.stop - 6 * len(parts)]
        if np.trace(left) < _LEAST_LEFT * max(float(own.sum()), 1e-30):
            continue
        table = _by_square(parts, normal, direction)
        score, spread = table.sum(0), table.T @ table
        if one.size == 1:
            z = float(abs(score[0]) / np.sqrt(max(spread[0, 0], 1e-300)))
            p_value = float(2 * stats.t.sf(z, len(table) - 1))
        else:
            keep = np.diag(spread) > 1e-9 * np.diag(spread).max()
            count = int(keep.sum())
            ridge = 0.05 * np.diag(np.diag(spread)[keep])  # squares are not many more than lasers
            form = float(score[keep] @ np.linalg.solve(spread[np.ix_(keep, keep)] + ridge, score[keep]))
            z = float(np.sqrt(form / count))
            p_value = float(stats.f.sf(form / count, count, max(len(table) - count, 1)))
        found.append((*one.name, z, min(1.0, p_value * len(candidates))))
    return found


def _findings(
    problem: _Problem, parameters: Sequence[_Parameter], p_values: dict[tuple[str, str], float]
) -> tuple[JointFinding, ...]:
    """Values and cluster-robust 95 % intervals."""
    if not parameters:
        return ()
    xyz = list(problem.points(problem.effects))
    surfels = problem.surfels(xyz)
    parts = problem.parts(parameters, surfels, xyz)
    normal = _normal(parts, len(surfels))
    poses = 6 * len(parts)
    matrix = _ridged(normal, parameters, poses)
    direction = linalg.solve(matrix, np.eye(len(matrix))[:, poses:], assume_a="pos")
    table = _by_square(parts, normal, direction)
    count = len(table)
    half = stats.t.ppf(0.975, count - 1) * np.sqrt((table**2).sum(0) * count / (count - 1))
    found, at = [], 0
    for one in parameters:
        part = half[at : at + one.size]
        at += one.size
        if one.effect.name == SweepMotion.name:
            value, part = np.array(problem.scale), part[:1]
            value, part = value * problem.pattern.sweep_s, part * problem.pattern.sweep_s
        else:
            value = np.asarray(getattr(one.effect, one.unknown.name), float)
        numbers = (value, value - (part if value.ndim else part[0]), value + (part if value.ndim else part[0]))
        plain = [tuple(row.tolist()) if row.ndim else float(row) for row in map(np.asarray, numbers)]
        found.append(JointFinding(*one.name, *plain, p_values[one.name]))
    return tuple(found)
