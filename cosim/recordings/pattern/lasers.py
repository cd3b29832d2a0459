"""Which lasers a sensor has: the cones that its points lie on, whatever order they come in.

A laser that spins draws a cone z = z0 + ρ·tan(e) about the sensor's axis: e is its elevation and z0 the height of its
optical centre. Range noise moves points along the cone and not off it, so they gather on lines in the plane of ρ and z.
The lines are found by a Hough transform (Duda and Hart, Comm. ACM 15, 1972) over e and z0, the strongest first, each
refined by a robust fit and its points taken away before the next is looked for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_CELL_DEG = 0.02
_CENTRES_M = np.arange(-0.30, 0.3001, 0.01)
_LOWEST_DEG, _HIGHEST_DEG = -90.0, 90.0
NEAREST_M = 1.0  # from the axis; closer points give inaccurate elevations
_MOST_POINTS = 600_000
_ROUNDINGS_M, _ROUNDED_POINTS = (0.1, 0.05, 0.02, 0.01, 0.005), 300  # finer steps blur nothing beyond a metre or two
_MOST_LASERS = 256
_HALF_WIDTH_DEG = 0.06  # of the strip about a peak whose points are fitted
_SAME_DEG = 0.05  # two lines nearer than this at ten metres are one laser and its outskirts
_AT_M = 10.0
_LEAST_SHARE = 0.003  # of the points of a usual laser
_NEAR_SHARE = 0.1  # of these, that a laser has which meets only what is near
_LEAST_POINTS = 12
_ABOVE_BACKGROUND = 6.0  # times what usual cells about a peak hold
_BACKGROUND_DEG = 2.0
_WEAK, _BESIDE_DEG = 0.4, 0.6  # a line with less than this share of the points of a line so close consists of outliers


@dataclass(frozen=True, eq=False)
class Lasers:
    """The lasers of a sensor, top first.

    Attributes:
        elevation_deg: (k,) elevations.
        elevation_sd_deg: (k,) standard errors, from how scans differ.
        centre_m: (k,) heights of the optical centres on the axis.
        misfit_deg: (k,) how far points lie off the cone, as a robust standard deviation of the angle.
        points: (k,) points on each.
        share: of all points that lie on a cone, 0–1.
    """

    elevation_deg: np.ndarray
    elevation_sd_deg: np.ndarray
    centre_m: np.ndarray
    misfit_deg: np.ndarray
    points: np.ndarray
    share: float

    def __len__(self) -> int:
        return len(self.elevation_deg)

    @property
    def lines(self) -> np.ndarray:
        """(k, 2) elevations [rad] and heights of the centres [m]."""
        return np.column_stack([np.radians(self.elevation_deg), self.centre_m])


def rounding_m(xyz: np.ndarray) -> float:
    """The step [m] that coordinates (n, 3) are multiples of, as in files with few decimals; 0 where there is none."""
    values = np.abs(xyz[:: max(1, len(xyz) // _ROUNDED_POINTS)]).ravel()
    values = values[values > 0]
    if len(values) < _ROUNDED_POINTS:
        return 0.0
    for step in _ROUNDINGS_M:
        off = np.abs(values / step - np.round(values / step))
        if np.mean(off < np.maximum(1e-3, 1e-6 * values / step)) > 0.99:
            return step
    return 0.0


def find_lasers(flat_range_m: np.ndarray, height_m: np.ndarray, scan: np.ndarray, rounding: float = 0.0) -> Lasers:
    """The lasers that points come from.

    Args:
        flat_range_m: (n,) distance from the sensor's axis.
        height_m: (n,) height above its origin.
        scan: (n,) int number of the scan of each point.
        rounding: step of the coordinates [m]: points so near that it blurs their elevation take no part.
    """
    nearest = max(NEAREST_M, rounding / 2 / np.tan(np.radians(_HALF_WIDTH_DEG)))
    if nearest > NEAREST_M:
        used, half = flat_range_m > nearest, 2 * _HALF_WIDTH_DEG
        rho, z, scan = flat_range_m[used], height_m[used], scan[used]
        step = max(1, -(-len(rho) // _MOST_POINTS))
        lines = _peel(rho[::step], z[::step], _CENTRES_M, half_deg=half)
        if not len(lines):
            return _none()
        return _own_points(fit_lasers(rho, z, scan, lines, half_deg=half), rho, z, scan, half)
    far = flat_range_m > NEAREST_M
    rho, z = flat_range_m[far], height_m[far]
    step = max(1, -(-len(rho) // _MOST_POINTS))
    lines = _peel(rho[::step], z[::step], _CENTRES_M)
    if not len(lines):
        return _none()
    found = _own_points(fit_lasers(rho, z, scan[far], lines), rho, z, scan[far])
    close, lines = _near_lasers(flat_range_m, height_m, ~far, found)
    if not len(lines):
        return found
    used = far | close
    rho, z, scan = flat_range_m[used], height_m[used], scan[used]
    return _own_points(fit_lasers(rho, z, scan, np.concatenate([found.lines, lines])), rho, z, scan)


def _own_points(
    lasers: Lasers, rho: np.ndarray, z: np.ndarray, scan: np.ndarray, half_deg: float = _HALF_WIDTH_DEG
) -> Lasers:
    """Fit the lasers again without those that are outliers of a strong neighbour."""
    for _ in range(3):
        kept = _kept(lasers)
        if kept.all():
            break
        lasers = fit_lasers(rho, z, scan, lasers.lines[kept], half_deg=half_deg)
    return lasers


def _near_lasers(rho: np.ndarray, z: np.ndarray, near: np.ndarray, lasers: Lasers) -> tuple[np.ndarray, np.ndarray]:
    """Points (n,) bool and lines (k, 2) of lasers that meet only what is near, as a steep one meets the vehicle's roof.

    Points at similar ranges do not determine their laser's centre: that of the other lasers is used.
    """
    _, off = nearest_laser(rho, z, lasers.lines)
    close = near & (np.abs(off) > np.radians(2 * _HALF_WIDTH_DEG))
    lines = _peel(rho[close], z[close], np.array([np.median(lasers.centre_m)]), lasers)
    return close, lines


def ring_lasers(flat_range_m: np.ndarray, height_m: np.ndarray, scan: np.ndarray, ring: np.ndarray) -> Lasers:
    """The lasers where the recording numbers them: one line through the points of each number (n,) int."""
    near = flat_range_m > NEAREST_M
    rho, z, scan, ring = flat_range_m[near], height_m[near], scan[near], ring[near]
    numbers = np.flatnonzero(np.bincount(ring) >= _LEAST_POINTS) if len(ring) else np.zeros(0, int)
    if not len(numbers):
        return _none()
    lines = []
    for number in numbers:
        own = ring == number
        start = np.array([np.median(np.arctan2(z[own], rho[own])), 0.0])
        lines.append(_robust_line(rho[own], z[own], start))
    table = np.array(lines)
    order = np.argsort(-table[:, 0])
    row_of = np.full(int(ring.max()) + 1, -1)
    row_of[numbers[order]] = np.arange(len(order))
    which = row_of[ring]
    known = which >= 0
    table = table[order]
    off = np.arctan2(z - table[which, 1], rho) - table[which, 0]
    return _described(table, which[known], off[known], scan[known])


def fit_lasers(
    rho: np.ndarray,
    z: np.ndarray,
    scan: np.ndarray,
    lines: np.ndarray,
    rounds: int = 3,
    half_deg: float = _HALF_WIDTH_DEG,
) -> Lasers:
    """Lasers refined on all points: each point to its nearest line, each line through its points.

    Args:
        rho, z, scan: (n,) as in `find_lasers`.
        lines: (k, 2) initial elevations [rad] and centres [m].
        rounds: of assigning and fitting.
        half_deg: half width of the strip about a line whose points are its own.
    """
    lines = lines[np.argsort(-lines[:, 0])]
    off, which = np.zeros(0), np.zeros(0, int)
    for _ in range(rounds):
        which, off = nearest_laser(rho, z, lines)
        for row in range(len(lines)):
            own = np.flatnonzero((which == row) & (np.abs(off) < np.radians(half_deg)))
            if len(own) >= _LEAST_POINTS:
                lines[row] = _robust_line(rho[own], z[own], lines[row])
    which, off = nearest_laser(rho, z, lines)
    return _described(lines, which, off, scan, half_deg)


def nearest_laser(rho: np.ndarray, z: np.ndarray, lines: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Row of the line (k, 2) that each point lies nearest to in angle, and how far above it [rad], (n,) each."""
    order = np.argsort(lines[:, 0])
    elevation, centre = lines[order, 0], lines[order, 1]
    rough = np.arctan2(z - np.median(centre), rho)
    slot = np.clip(np.searchsorted(elevation, rough), 0, len(order) - 1)
    best, off = np.zeros(len(rho), int), np.full(len(rho), np.inf)
    for aside in range(-3, 3):  # centres that differ carry near points past their neighbours
        candidate = np.clip(slot + aside, 0, len(order) - 1)
        angle = np.arctan2(z - centre[candidate], rho) - elevation[candidate]
        nearer = np.abs(angle) < np.abs(off)
        best, off = np.where(nearer, order[candidate], best), np.where(nearer, angle, off)
    return best, off


def _peel(
    rho: np.ndarray,
    z: np.ndarray,
    centres: np.ndarray,
    known: Lasers | None = None,
    half_deg: float = _HALF_WIDTH_DEG,
) -> np.ndarray:
    """Lines (k, 2) through points (n,), the strongest first.

    Args:
        rho, z: of the points.
        centres: heights of optical centres to try [m].
        known: lasers whose points are not among these.
        half_deg: half width of the strip about a line whose points are its own.
    """
    blurred = half_deg > _HALF_WIDTH_DEG  # a laser whose points are all about as far draws many lines through them
    votes = _votes(rho, z, centres)
    lines: list[np.ndarray] = [] if known is None else list(known.lines)
    counts: list[int] = [] if known is None else known.points.tolist()
    least, given = _LEAST_SHARE if known is None else _NEAR_SHARE, len(lines)
    refused = 0
    while len(lines) < _MOST_LASERS and len(rho) >= _LEAST_POINTS and refused < 20:
        height = votes[:, :-2] + votes[:, 1:-1] + votes[:, 2:]
        row, cell = np.unravel_index(int(height.argmax()), height.shape)
        peak = int(height[row, cell])
        floor = max(_LEAST_POINTS, least * float(np.median(counts)) if counts else 0.0)
        if peak < floor:
            break
        elevation = np.radians(_LOWEST_DEG + (cell + 1.5) * _CELL_DEG)
        guess = np.array([elevation, centres[row]])
        strip = np.flatnonzero(np.abs(np.arctan2(z - guess[1], rho) - elevation) < np.radians(half_deg))
        line = _robust_line(rho[strip], z[strip], guess) if len(strip) >= _LEAST_POINTS else guess
        own = np.abs(np.arctan2(z - line[1], rho) - line[0]) < np.radians(half_deg)
        own[strip] |= np.abs(np.arctan2(z[strip] - guess[1], rho[strip]) - elevation) < np.radians(2 * _CELL_DEG)
        if _is_new(line, lines, float(np.median(rho[own])) if blurred and own.any() else _AT_M) and _stands_out(
            votes[row], int(cell) + 1, peak
        ):
            lines.append(line)
            counts.append(int(own.sum()))
        else:
            refused += 1
        votes -= _votes(rho[own], z[own], centres)
        rho, z = rho[~own], z[~own]
    return np.array(lines[given:]).reshape(-1, 2)


def _kept(lasers: Lasers) -> np.ndarray:
    """(k,) bool: lasers with their own points, not only outliers of a strong neighbour."""
    apart = lasers.elevation_deg[:, None] - lasers.elevation_deg
    below = np.where((apart > 0) & (apart < _BESIDE_DEG), lasers.points, 0).max(1)
    above = np.where((apart < 0) & (apart > -_BESIDE_DEG), lasers.points, 0).max(1)
    return (lasers.points >= _LEAST_POINTS) & (lasers.points >= _WEAK * np.minimum(below, above))


def _votes(rho: np.ndarray, z: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Points by centre and elevation, (centres, cells) int64."""
    cells = round((_HIGHEST_DEG - _LOWEST_DEG) / _CELL_DEG)
    votes = np.empty((len(centres), cells), np.int64)
    for row, centre in enumerate(centres):
        cell = (np.degrees(np.arctan2(z - centre, rho)) - _LOWEST_DEG) / _CELL_DEG
        votes[row] = np.bincount(np.clip(cell.astype(np.int64), 0, cells - 1), minlength=cells)
    return votes


def _is_new(line: np.ndarray, lines: list[np.ndarray], at_m: float) -> bool:
    """Whether a line is none of some others, ten metres away and at another distance."""
    if not lines:
        return True
    known = np.array(lines)
    apart = [
        np.degrees(np.abs(known[:, 1] - line[1] + away * (np.tan(known[:, 0]) - np.tan(line[0]))) / away).min()
        for away in (_AT_M, at_m)
    ]
    return bool(apart[0] > _SAME_DEG and apart[1] > (2 * _HALF_WIDTH_DEG if at_m != _AT_M else _SAME_DEG))


def _stands_out(row: np.ndarray, cell: int, peak: int) -> bool:
    half = round(_BACKGROUND_DEG / _CELL_DEG)
    about = row[max(cell - half, 0) : cell + half + 1]
    return peak > _ABOVE_BACKGROUND * 3 * float(np.quantile(about, 0.3))


def _robust_line(rho: np.ndarray, z: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Elevation [rad] and centre [m] of the line through points: least squares in the angle, outliers left out.

    If all points are at similar ranges, the centre cannot be determined and is not changed.
    """
    elevation, centre = float(start[0]), float(start[1])
    for _ in range(4):
        off = np.arctan2(z - centre, rho) - elevation
        middle = float(np.median(off))
        spread = max(1.4826 * float(np.median(np.abs(off - middle))), 1e-5)
        good = np.abs(off - middle) < 3 * spread
        lever = np.cos(elevation) ** 2 / rho[good]  # how the angle changes with the centre
        level = lever - lever.mean()
        known = float(level @ level)
        raised = float(level @ off[good]) / known if known * 0.005**2 > spread**2 else 0.0
        raised = float(np.clip(raised, -0.05, 0.05))
        centre = float(np.clip(centre + raised, _CENTRES_M[0], _CENTRES_M[-1]))
        elevation += float(np.mean(off[good])) - raised * float(lever.mean())
    return np.array([elevation, centre])


def _described(
    lines: np.ndarray, which: np.ndarray, off: np.ndarray, scan: np.ndarray, half_deg: float = _HALF_WIDTH_DEG
) -> Lasers:
    count = len(lines)
    on = np.abs(off) < np.radians(half_deg)
    misfit, error = np.zeros(count), np.zeros(count)
    for row in range(count):
        own = np.flatnonzero(on & (which == row))
        if not len(own):
            continue
        misfit[row] = 1.4826 * np.degrees(np.median(np.abs(off[own])))
        scans = scan[own]
        per = np.bincount(scans)
        means = np.bincount(scans, off[own])[per > 0] / per[per > 0]
        sd = float(np.std(means, ddof=1)) / np.sqrt(len(means)) if len(means) > 2 else np.radians(misfit[row])
        error[row] = np.degrees(sd)
    return Lasers(
        elevation_deg=np.degrees(lines[:, 0]),
        elevation_sd_deg=error,
        centre_m=lines[:, 1].copy(),
        misfit_deg=misfit,
        points=np.bincount(which[on], minlength=count),
        share=float(on.mean()) if len(on) else 0.0,
    )


def _none() -> Lasers:
    nothing = np.zeros(0)
    return Lasers(nothing, nothing, nothing, nothing, np.zeros(0, int), 0.0)
