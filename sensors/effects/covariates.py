"""Covariates: quantities on which an effect may depend, as a simulation computes them for returns of a revolution.

The names are those of `cosim diagnose --json`. What a covariate is not known for gets NaN or no category, and effects
do nothing there: incidence of a beam that meets nothing, or a covariate that only measurements have, such as `edge`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from assets.materials import MATERIAL_NAMES
from sensors.hits import NOTHING, STATIC
from sensors.returns import Returns
from sensors.shot import Shot

OBJECT_REACH_M = 80.0
OBJECT_FAR_M = 12.0
RETRO_REACH = 32
SAME_SCAN_S = 0.01
SEEN_OR_LOST = ("seen", "lost")
_TURN = 2 * np.pi


@dataclass(frozen=True, eq=False)
class Categories:
    """Categories of m returns.

    Attributes:
        codes: (m,) int rows of `names`; −1 where the category is not known.
        names: of the categories.
    """

    codes: np.ndarray
    names: tuple[str, ...]

    def look_up(self, table: Mapping[str, float]) -> np.ndarray:
        """Return the values (m,) of a table by name; 0 for names that it does not have."""
        values = np.array([*(table.get(name, 0.0) for name in self.names), 0.0])
        return values[self.codes]

    @property
    def is_known(self) -> np.ndarray:
        """(m,) bool."""
        return self.codes >= 0


Values = np.ndarray | Categories


@dataclass(frozen=True)
class Covariate:
    """A covariate.

    Attributes:
        name: as in `cosim diagnose --json`.
        unit: of its values; empty for pure numbers and categories.
        words: what it is.
        compute: gives its values from returns, the shot, and the returns among which neighbours are looked up.
        period: of a cyclic covariate, which starts at −period/2; 0 for others.
        of_surface: whether it depends on the surface that a beam meets.
        of_signal: whether it depends on intensities, or on which beams returned; unknown before beams are traced.
        of_world: whether it needs the world and not only stored hits.
        is_simulated: whether a simulation can compute it at all.
    """

    name: str
    unit: str
    words: str
    compute: Callable[[Returns, Shot, Returns | None], Values]
    period: float = 0.0
    of_surface: bool = False
    of_signal: bool = False
    of_world: bool = False
    is_simulated: bool = True


def covariate_values(name: str, returns: Returns, shot: Shot, among: Returns | None = None) -> Values:
    """Compute a covariate.

    Args:
        name: of the covariate.
        returns: m rows.
        shot: of the revolution; traced, where the covariate depends on surfaces.
        among: returns among which neighbours are looked up; by default `returns`.

    Returns:
        (m,) float64, NaN where it is not known; or categories.
    """
    covariate = COVARIATES[name]
    values = covariate.compute(returns, shot, among)
    if not covariate.of_surface:
        return values
    met = returns.instance != NOTHING
    if isinstance(values, Categories):
        return Categories(np.where(met, values.codes, -1), values.names)
    return np.where(met, values, np.nan)


def neighbour_is(lost: bool, count: int) -> Categories:
    """Return the category of `count` neighbours that are all lost, or all seen."""
    return Categories(np.full(count, int(lost)), SEEN_OR_LOST)


def level_at(time_s: np.ndarray, levels: Mapping[float, float]) -> np.ndarray:
    """Return the levels (m,) of scans by their pose times [s]; 0 at the times of other scans."""
    times = np.array(list(levels))
    nearest = np.abs(np.asarray(time_s)[:, None] - times).argmin(1)
    is_same = np.abs(time_s - times[nearest]) < SAME_SCAN_S
    return np.where(is_same, np.array(list(levels.values()))[nearest], 0.0)


def nearest_row(values: Any, rows: np.ndarray | Sequence[float] | Sequence[str], period: float = 0.0) -> np.ndarray:
    """Return for each value the row (m,) int of a table that applies; −1 for categories that it does not have.

    Args:
        values: (m,) numbers or `Categories`.
        rows: (b,) centres of bins, rising, or names of categories.
        period: of cyclic numbers.
    """
    if isinstance(values, Categories):
        return values.look_up({str(name): row + 1.0 for row, name in enumerate(rows)}).astype(int) - 1
    centres = np.asarray(rows, float)
    if period:  # from half-way between the last bin and the first one, one turn on
        low = (centres[0] + centres[-1] - period) / 2
        values = np.mod(np.asarray(values) - low, period) + low
    return np.searchsorted((centres[1:] + centres[:-1]) / 2, values)


def cell_of(table: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Return the values (m,) of a table (a, b) at rows and columns (m,); 0 where one of them is −1."""
    return np.where((row >= 0) & (column >= 0), table[row, column], 0.0)


def wrapped(angle: Any, period: float) -> Any:
    """Return angles, numbers or arrays, from −period/2 to period/2."""
    return np.mod(angle + period / 2, period) - period / 2


def world_azimuth(returns: Returns, shot: Shot) -> np.ndarray:
    """Direction (m,) [rad] of nominal beams about the vertical, counter-clockwise from the world's x axis."""
    direction = shot.rays.direction[returns.beam] @ shot.lidar_pose[:3, :3].T
    return np.arctan2(direction[:, 1], direction[:, 0])


def retro_distance(returns: Returns, shot: Shot) -> np.ndarray:
    """Firings (m,) to the nearest beam of the ring on a retro-reflector, 0.5 on it, at most 64; NaN without rings."""
    whole = shot.whole or shot
    rows = returns.beam if shot.rows is None else shot.rows[returns.beam]

    def compute() -> np.ndarray:
        pattern, solid = whole.pattern, whole.hits.solid
        if len(solid) != pattern.rings * pattern.firings:  # a depth camera has no rings
            return np.full(len(solid), np.nan)
        is_retro = whole.hits.table.column("retro")[solid.material] & solid.exists
        marked = is_retro.reshape(pattern.rings, pattern.firings)
        steps = np.full(marked.shape, 2.0 * RETRO_REACH)
        for step in range(RETRO_REACH, 0, -1):
            steps[np.roll(marked, step, 1) | np.roll(marked, -step, 1)] = step
        steps[marked] = 0.5
        return steps.ravel()

    return whole.lasting("firings to reflectors", compute)[rows]


def object_distance(returns: Returns, shot: Shot) -> np.ndarray:
    """Horizontal distance (m,) [m] of static surfaces from the nearest object's box, at most 12 m; NaN on objects.

    Objects farther than 80 m from the sensor do not count; without any the distance is not known.
    """
    if shot.world is None:
        return np.full(len(returns), np.nan)
    instances, centre = shot.world.instances, shot.lidar_pose[:2, 3]
    beams = shot.every_beam
    is_static = beams.instance == STATIC

    def compute() -> np.ndarray:
        points = shot.points_in_world(beams.take(is_static))
        nearest = np.full(len(points), np.inf)
        for pose, size in zip(instances.poses, instances.sizes, strict=True):
            if np.linalg.norm(pose[:2, 3] - centre) < OBJECT_REACH_M:
                outside = np.abs((points - pose[:3, 3]) @ pose[:3, :2]) - size[:2] / 2
                nearest = np.minimum(nearest, np.hypot(*np.maximum(outside, 0).T))
        found = np.full(len(beams), np.nan)
        found[is_static] = np.where(np.isfinite(nearest), np.minimum(nearest, OBJECT_FAR_M), np.nan)
        return found

    return shot.kept("distances from objects", compute)[returns.beam]


def _of_scan(value: Callable[[Shot], float]) -> Callable[[Returns, Shot, Returns | None], np.ndarray]:
    return lambda returns, shot, among: np.full(len(returns), float(value(shot)))


def _of_ego(value: Callable[[Shot], float]) -> Callable[[Returns, Shot, Returns | None], np.ndarray]:
    return _of_scan(lambda shot: np.nan if shot.world is None else value(shot))


def _signal(returns: Returns, shot: Shot, among: Returns | None) -> np.ndarray:
    """Intensities before noise."""
    if shot.noiseless is None:
        return returns.intensity.astype(float)
    known = np.full((2, len(shot.rays)), np.nan)
    lit = shot.noiseless
    known[np.minimum(lit.return_no, 1), lit.beam] = lit.intensity
    return known[np.minimum(returns.return_no, 1), returns.beam]


def _codes(values: np.ndarray, names: tuple[str, ...]) -> Categories:
    return Categories(np.asarray(values).astype(int), names)


def _names(what: str) -> Callable[[Returns, Shot, Returns | None], Categories]:
    def compute(returns: Returns, shot: Shot, among: Returns | None) -> Categories:
        words = shot.named(what, returns)
        names, codes = np.unique(words, return_inverse=True)
        return Categories(np.where(words == "", -1, codes), tuple(names.tolist()))

    return compute


def _nothing(returns: Returns, shot: Shot, among: Returns | None) -> np.ndarray:
    return np.full(len(returns), np.nan)


def _neighbours() -> list[Covariate]:
    """Measurements of the neighbouring beams, see `Shot.beside`."""
    words = {
        "previous": "of the beam fired before in the ring",
        "above": "of the beam fired together, one ring higher",
        "below": "of the beam fired together, one ring lower",
    }

    def number(name: str) -> Callable[[Returns, Shot, Returns | None], Values]:
        return lambda returns, shot, among: shot.beside(name, returns, among).astype(float)

    def lost(name: str) -> Callable[[Returns, Shot, Returns | None], Values]:
        return lambda returns, shot, among: _codes(shot.beside(name, returns, among), SEEN_OR_LOST)

    found = []
    for whose, text in words.items():
        found += [
            Covariate(f"{whose}_range", "m", f"range {text}", number(f"{whose}_range"), of_signal=True),
            Covariate(f"{whose}_intensity", "", f"intensity {text}", number(f"{whose}_intensity"), of_signal=True),
            Covariate(f"{whose}_lost", "", f"loss {text}", lost(f"{whose}_lost"), of_signal=True),
        ]
    return found


_ALL = [
    Covariate("constant", "", "the same for all beams", _of_scan(lambda shot: 0.0)),
    Covariate("range", "m", "range", lambda r, s, a: r.range_m.astype(float), of_surface=True),
    Covariate(
        "incidence", "deg", "angle between the beam and the surface's normal",
        lambda r, s, a: np.degrees(np.arccos(s.cos_incidence(r).astype(float))), of_surface=True,
    ),
    Covariate(
        "elevation", "deg", "nominal elevation of the beam",
        lambda r, s, a: np.degrees(np.arcsin(np.clip(s.rays.direction[r.beam, 2].astype(float), -1, 1))),
    ),
    Covariate(
        "azimuth", "rad", "nominal azimuth of the beam, counter-clockwise from ahead",
        lambda r, s, a: s.rays.azimuth[r.beam].astype(float), _TURN,
    ),
    Covariate(
        "firing_time", "s", "firing time within the sweep", lambda r, s, a: s.rays.time_s[r.beam].astype(float)
    ),
    Covariate("frame_time", "s", "pose time of the scan", _of_scan(lambda shot: shot.frame_time_s)),
    Covariate("scan", "s", "pose time of the scan", _of_scan(lambda shot: shot.frame_time_s)),
    Covariate(
        "time", "s", "pose time of the scan plus firing time",
        lambda r, s, a: s.frame_time_s + s.rays.time_s[r.beam].astype(float),
    ),
    Covariate("albedo", "", "reflectance of the surface", lambda r, s, a: r.reflectance.astype(float), of_surface=True),
    Covariate("intensity", "", "expected intensity", _signal, of_surface=True, of_signal=True),
    Covariate(
        "speed", "m/s", "speed of the vehicle",
        _of_ego(lambda shot: float(np.linalg.norm(shot.world.ego.velocity_mps))), of_world=True,  # type: ignore
    ),
    Covariate(
        "acceleration", "m/s²", "forward acceleration of the vehicle",
        _of_ego(lambda shot: shot.world.ego.forward_acceleration_mps2), of_world=True,  # type: ignore
    ),
    Covariate(
        "yaw_rate", "rad/s", "yaw rate of the vehicle, counter-clockwise",
        _of_ego(lambda shot: shot.world.ego.yaw_rate_radps), of_world=True,  # type: ignore
    ),
    Covariate("world_x", "m", "world x of the surface", lambda r, s, a: s.points_in_world(r)[:, 0], of_surface=True),
    Covariate("world_y", "m", "world y of the surface", lambda r, s, a: s.points_in_world(r)[:, 1], of_surface=True),
    Covariate(
        "world_azimuth", "rad", "direction of the beam in the world, counter-clockwise from its x axis",
        lambda r, s, a: world_azimuth(r, s), _TURN,
    ),
    Covariate(
        "retro_distance", "firings", "number of firings to the nearest retro-reflector in the ring",
        lambda r, s, a: retro_distance(r, s), of_surface=True,
    ),
    Covariate(
        "object_distance", "m", "horizontal distance from the nearest object",
        lambda r, s, a: object_distance(r, s), of_surface=True, of_world=True,
    ),
    Covariate(
        "ring", "", "laser, 0 on top",
        lambda r, s, a: _codes(s.rays.ring[r.beam], tuple(map(str, range(s.pattern.rings)))),
    ),
    Covariate("block", "", "optical block", lambda r, s, a: _codes(s.block[r.beam], ("upper", "lower"))),
    Covariate(
        "material", "", "material of the surface",
        lambda r, s, a: _codes(
            r.material, (*MATERIAL_NAMES, *(str(code) for code in range(len(MATERIAL_NAMES), 256)))
        ),
        of_surface=True,
    ),
    Covariate("kind", "", "class of the object", _names("kinds"), of_surface=True, of_world=True),
    Covariate("model", "", "model of the object", _names("models"), of_surface=True, of_world=True),
    Covariate("instance", "", "object", _names("ids"), of_surface=True, of_world=True),
    Covariate("edge", "", "nearness of the beam to an edge of uncertain position", _nothing, is_simulated=False),
    Covariate("sun_azimuth", "rad", "azimuth from the sun", _nothing, _TURN, is_simulated=False),
    Covariate("object_size", "m", "change of length, width and height", _nothing, is_simulated=False),
    Covariate("object_place", "m", "shift ahead, left and up in the object's axes", _nothing, is_simulated=False),
    *_neighbours(),
]  # fmt: skip
COVARIATES: dict[str, Covariate] = {covariate.name: covariate for covariate in _ALL}
