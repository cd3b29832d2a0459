"""Cache of surfaces in footprints of other radii: where two of them agree, radii in between need no ray."""

from __future__ import annotations

from bisect import bisect_left

import numpy as np

from sensors.effects.surfaces.footprint import directions_aside
from sensors.hits import Surface
from sensors.normals import dot_with_normals
from sensors.shot import Shot

SAMPLES = 4
TURNED = 36  # steps of a normal code: about a degree
_APART_RAD = 5e-4  # distance of sampled radii; narrower objects between them are ignored
_OFF_FACE_M, _OFF_FACE_SHARE = 0.01, 0.15
_MOST = 12


class FootprintCache:
    """Samples around some beams of a revolution, as traced.

    Args:
        shot: of some beams of a revolution.
        beam: (k,) rows of the requested beams.
    """

    def __init__(self, shot: Shot, beam: np.ndarray) -> None:
        whole, rows, world = shot.whole, shot.rows, shot.world
        if whole is None or whole.traced is None or rows is None or world is None:
            raise ValueError("footprints of some beams need the traced revolution that these are of")
        rows = rows[beam]
        self._world, self._limit_m = world, shot.pattern.range_m[1]
        self._origin, self._direction = whole.traced.origin[rows], whole.traced.direction[rows]
        self._time_s = np.broadcast_to(whole.traced.time_s, len(whole.rays))[rows]
        middle = whole.hits.solid.take(rows)
        self._radii = [0.0]
        self._met = [middle.take(np.repeat(np.arange(len(beam)), SAMPLES))]

    def met(self, radius_rad: float) -> Surface:
        """Surfaces (4 · k) that samples of footprints of a radius hit."""
        index = bisect_left(self._radii, radius_rad)
        if index < len(self._radii) and self._radii[index] == radius_rad:
            return self._met[index]
        found = self._traced(radius_rad, index)
        self._radii.insert(index, radius_rad)
        self._met.insert(index, found)
        if len(self._radii) > _MOST:
            farthest = max(range(1, len(self._radii)), key=lambda row: abs(self._radii[row] - radius_rad))
            del self._radii[farthest], self._met[farthest]
        return found

    def bent(self, radius_rad: float, origin: np.ndarray, direction: np.ndarray, time_s: np.ndarray) -> Surface:
        """Surfaces that samples of deflected beams (k) hit: the planes of the traced beams, moved with their objects.

        Args:
            radius_rad: of the footprints.
            origin: (k, 3) world axes.
            direction: (k, 3) float32, of the middles.
            time_s: (k,) instants. Planes of objects move with the velocity of the point that is hit.
        """
        met = self.met(radius_rad)
        if origin is self._origin or (
            np.array_equal(direction, self._direction)
            and np.allclose(origin, self._origin, rtol=0, atol=1e-4)
            and np.array_equal(time_s, self._time_s)
        ):
            return met
        before, after = self._rays(radius_rad), directions_aside(direction, radius_rad).reshape(-1, 3)
        shift = np.repeat(origin - self._origin, SAMPLES, axis=0)
        shift = (shift - self._displacement(met, before, time_s)).astype(np.float32)
        toward, onward, aside = (dot_with_normals(met.normal_code, one) for one in (before, after, shift))
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = (met.range_m * toward - aside) / onward
        columns = {
            "range_m": np.where(np.isfinite(reach) & (reach > 0), reach, np.inf).astype(np.float32),
            "normal_code": met.normal_code,
            "material": met.material,
            "instance": met.instance,
        }
        return Surface(**columns)

    def _displacement(self, met: Surface, direction: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Displacement (4 · k, 3) [m] of the points that samples hit since they were traced, to first order in time."""
        later_s = np.repeat(time_s - self._time_s, SAMPLES).astype(np.float64)
        displacement = np.zeros((len(later_s), 3))
        rows = np.flatnonzero((met.instance >= 0) & (later_s != 0))
        if not len(rows):
            return displacement
        instances, of = self._world.instances, met.instance[rows]
        point = self._origin[rows // SAMPLES] + direction[rows] * met.range_m[rows, None]
        arm = point - instances.poses[of, :3, 3]
        turn = np.column_stack([-arm[:, 1], arm[:, 0], np.zeros(len(rows))])
        velocity = instances.velocity_mps[of] + instances.yaw_rate_radps[of, None] * turn
        displacement[rows] = velocity * later_s[rows, None]
        return displacement

    def _traced(self, radius_rad: float, index: int) -> Surface:
        """Surfaces at a radius between known ones: by new rays where these do not agree."""
        below, onward = self._met[index - 1], self._rays(radius_rad)
        columns = {name: getattr(below, name) for name in ("range_m", "normal_code", "material", "instance")}
        agreed = np.zeros(len(onward), bool)
        if index < len(self._radii) and self._radii[index] - self._radii[index - 1] <= _APART_RAD:
            above = self._met[index]
            agreed = self._on_one_face(index)
            share = (radius_rad - self._radii[index - 1]) / (self._radii[index] - self._radii[index - 1])
            with np.errstate(divide="ignore"):
                # Along a line over a plane the inverse of the range is linear.
                columns["range_m"] = (1 / ((1 - share) / below.range_m + share / above.range_m)).astype(np.float32)
        rows = np.flatnonzero(~agreed)
        of = rows // SAMPLES
        anew = self._world.shoot(self._origin[of], onward[rows], self._time_s[of], self._limit_m)
        return Surface(**_with_rows(columns, rows, anew))

    def _on_one_face(self, index: int) -> np.ndarray:
        """(4 · k) bool: samples that meet one face at a known radius and at the one before."""
        below, above = self._met[index - 1], self._met[index]
        turned = np.abs(below.normal_code.astype(np.int32) - above.normal_code).max(1)
        same = (turned < TURNED) & (below.material == above.material) & (below.instance == above.instance)
        toward, onward = (
            dot_with_normals(below.normal_code, self._rays(self._radii[row])) for row in (index - 1, index)
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            foreseen = below.range_m * (toward / onward)
            off = np.abs(above.range_m - foreseen)
            most = _OFF_FACE_M + _OFF_FACE_SHARE * np.abs(above.range_m - below.range_m)
        return same & ((off <= most) | ~below.exists)

    def _rays(self, radius_rad: float) -> np.ndarray:
        return directions_aside(self._direction, radius_rad).reshape(-1, 3)


def _with_rows(columns: dict[str, np.ndarray], rows: np.ndarray, met: Surface) -> dict[str, np.ndarray]:
    """Columns of surfaces with others in some rows."""
    changed = {}
    for name, values in columns.items():
        changed[name] = np.array(values)
        changed[name][rows] = getattr(met, name)
    return changed
