"""Lasers of a sensor: the cones on which its points lie, in any order of the points.

A laser that spins draws a cone z = z0 + ρ·tan(e) about the sensor's axis: e is its elevation and z0 the height of its
optical centre. Range noise moves points along the cone and not off it, so they gather on lines in the plane of ρ and z.
The lines are found by a Hough transform (Duda and Hart, Comm. ACM 15, 1972) over e and z0, the strongest first, each
refined by a robust fit and its points taken away before the next is looked for.

Rounded coordinates blur the elevation of a point by the step over its distance. So lines are looked for in the sharpest
points first, then among nearer points that lie on none of them, each point within the tolerance of its own blur. A line
stays if the likelihood of the points needs it (Bayesian information criterion: Schwarz, Ann. Stat. 6, 1978).
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
_SHARPEST_DEG = 0.002  # least standard deviation of elevations about a laser's cone
_MEDIAN_SQUARE = 0.455  # of a standard normal variable
_APART = 8.0  # standard deviations between lines that cannot be one
_OUTLYING = 1e-3  # density of outliers relative to that at the peak of a line
_LIKE_NEIGHBOURS = 9  # lasers whose median centre a laser has, unless its points show another
_LINE_PARAMETERS = 3  # elevation, centre, share of the points
_HALF_WIDTH_DEG = 0.06  # of the strip about a peak whose points are fitted, if they are not blurred
_BLURS_DEG = (0.02, 0.04, 0.08, 0.16, 0.32)  # largest standard errors of rounded elevations, step by step
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


def blur_rad(rounding: float, flat_range_m: np.ndarray, height_m: np.ndarray) -> np.ndarray:
    """(n,) standard error of the elevations of points whose coordinates are rounded to a step [m].

    The error of a rounded number is uniform over a step, and its standard deviation is the step over √12.
    """
    return rounding / np.sqrt(12) / np.maximum(np.hypot(flat_range_m, height_m), rounding or 1.0)


def half_width_rad(blur: np.ndarray) -> np.ndarray:
    """(n,) half widths of the strips about a laser's cone in which its points with a blur (n,) [rad] lie."""
    return np.hypot(np.radians(_HALF_WIDTH_DEG), 2 * blur)


def find_lasers(flat_range_m: np.ndarray, height_m: np.ndarray, scan: np.ndarray, rounding: float = 0.0) -> Lasers:
    """The lasers that points come from.

    Args:
        flat_range_m: (n,) distance from the sensor's axis.
        height_m: (n,) height above its origin.
        scan: (n,) int number of the scan of each point.
        rounding: step of the coordinates [m]; 0 if they are not rounded.
    """
    blur = blur_rad(rounding, flat_range_m, height_m)
    far = flat_range_m > NEAREST_M
    found = _none()
    for blur_deg in _BLURS_DEG if rounding else (0.0,):
        used = far & (blur <= np.radians(blur_deg))
        found = _with_more(found, flat_range_m, height_m, scan, blur, used, used, _CENTRES_M)
    if not len(found):
        return found
    return _with_more(found, flat_range_m, height_m, scan, blur, ~far, far, _CENTRES_M)


def _with_more(
    lasers: Lasers,
    rho: np.ndarray,
    z: np.ndarray,
    scan: np.ndarray,
    blur: np.ndarray,
    searched: np.ndarray,
    used: np.ndarray,
    centres: np.ndarray,
) -> Lasers:
    """Lasers, and those of points on none of them, fitted to all points.

    Points at similar ranges do not determine the centre of their laser, as those of a steep laser that meets only the
    vehicle's roof or the ground close by: if there are lasers, others start from the median centre of all, of the
    upper or of the lower half of these.

    Args:
        lasers: found so far.
        rho, z, scan, blur: (n,) points.
        searched: (n,) bool points that may lie on further lasers.
        used: (n,) bool points to fit, besides those searched that lie on no laser so far.
        centres: heights of optical centres to try [m].
    """
    rest = searched
    if len(lasers):
        _, off = nearest_laser(rho, z, lasers.lines)
        rest = searched & (np.abs(off) > 2 * half_width_rad(blur))
        half_way = len(lasers) // 2
        parts = (lasers.centre_m, lasers.centre_m[:half_way], lasers.centre_m[half_way:])
        centres = np.unique([np.median(part) for part in parts if len(part)])
    rows = np.flatnonzero(rest)
    rows = rows[:: max(1, -(-len(rows) // _MOST_POINTS))]
    lines = _peel(rho[rows], z[rows], blur[rows], centres, lasers)
    rows = np.flatnonzero(used | rest)
    if not len(lines) and (not len(lasers) or not len(np.flatnonzero(used & searched))):
        return lasers
    every = np.concatenate([lasers.lines, lines])
    return _own_points(fit_lasers(rho[rows], z[rows], scan[rows], every, blur[rows]), rho, z, scan, blur, rows)


def _own_points(
    lasers: Lasers,
    rho: np.ndarray,
    z: np.ndarray,
    scan: np.ndarray,
    blur: np.ndarray,
    rows: np.ndarray,
) -> Lasers:
    """Fit the lasers again without those that the points do not need."""
    rho, z, scan, blur = rho[rows], z[rows], scan[rows], blur[rows]
    while len(lasers):
        lines = _merged(lasers.lines[_kept(lasers)], rho, z, blur)
        if len(lines) == len(lasers):
            break
        lasers = fit_lasers(rho, z, scan, lines, blur)
    return lasers


def _merged(lines: np.ndarray, rho: np.ndarray, z: np.ndarray, blur: np.ndarray) -> np.ndarray:
    """Lines (k, 2) where two neighbours that fit their points no better than one line are one.

    The two models, a mixture of two lines and one line, are compared by the Bayesian information criterion; the
    variance of elevations is that by rounding and a common one of all lasers. Points of equal height have the
    same error of rounding, so they count as one.
    """
    if len(lines) < 2 or not blur.any():
        return lines
    lines = lines[np.argsort(-lines[:, 0])]
    which, off = nearest_laser(rho, z, lines)
    on = np.abs(off) < half_width_rad(blur)
    own_var = np.median(off[on] ** 2) / _MEDIAN_SQUARE - np.median(blur[on] ** 2)
    sd = np.sqrt(max(float(own_var), np.radians(_SHARPEST_DEG) ** 2) + blur**2)
    order = np.argsort(which[on], kind="stable")
    rows = np.split(np.flatnonzero(on)[order], np.cumsum(np.bincount(which[on], minlength=len(lines)))[:-1])
    kept, row = [], 0
    while row < len(lines):
        one = None
        if row + 1 < len(lines):
            own = np.concatenate([rows[row], rows[row + 1]])
            one = _one_line(lines[row : row + 2], (len(rows[row]), len(rows[row + 1])), rho[own], z[own], sd[own])
        kept.append(lines[row] if one is None else one)
        row += 1 if one is None else 2
    return np.array(kept)


def _one_line(
    pair: np.ndarray, counts: tuple[int, int], rho: np.ndarray, z: np.ndarray, sd: np.ndarray
) -> np.ndarray | None:
    """The line of the points of two lines (2, 2) if it describes them as well; None if both are needed.

    Args:
        pair: the lines.
        counts: points of each.
        rho, z: (n,) points of both.
        sd: (n,) standard deviations of their elevations [rad].
    """
    if not len(rho):
        return pair[0]
    off = np.arctan2(z - pair[:, 1:], rho) - pair[:, :1]
    if np.median(np.abs(off[0] - off[1]) / sd) > _APART:
        return None
    line = _robust_line(rho, z, sd, pair[int(np.argmax(counts))])
    share = np.array(counts)[:, None] / len(rho)
    two = np.log(_OUTLYING + (share * np.exp(-0.5 * (off / sd) ** 2)).sum(0))
    single = np.log(_OUTLYING + np.exp(-0.5 * ((np.arctan2(z - line[1], rho) - line[0]) / sd) ** 2))
    independent = len(np.unique(z))
    gain = float((two - single).sum()) * independent / len(rho)
    return line if gain < 0.5 * _LINE_PARAMETERS * np.log(independent) else None


def ring_lasers(
    flat_range_m: np.ndarray, height_m: np.ndarray, scan: np.ndarray, ring: np.ndarray, rounding: float = 0.0
) -> Lasers:
    """The lasers where the recording numbers them: one line through the points of each number (n,) int."""
    near = flat_range_m > NEAREST_M
    rho, z, scan, ring = flat_range_m[near], height_m[near], scan[near], ring[near]
    blur = blur_rad(rounding, rho, z)
    numbers = np.flatnonzero(np.bincount(ring) >= _LEAST_POINTS) if len(ring) else np.zeros(0, int)
    if not len(numbers):
        return _none()
    lines = []
    for number in numbers:
        own = ring == number
        start = np.array([np.median(np.arctan2(z[own], rho[own])), 0.0])
        lines.append(_robust_line(rho[own], z[own], blur[own], start))
    table = np.array(lines)
    order = np.argsort(-table[:, 0])
    row_of = np.full(int(ring.max()) + 1, -1)
    row_of[numbers[order]] = np.arange(len(order))
    which = row_of[ring]
    known = which >= 0
    table = table[order]
    off = np.arctan2(z - table[which, 1], rho) - table[which, 0]
    return _described(table, which[known], off[known], scan[known], blur[known])


def fit_lasers(
    rho: np.ndarray,
    z: np.ndarray,
    scan: np.ndarray,
    lines: np.ndarray,
    blur: np.ndarray,
    rounds: int = 3,
) -> Lasers:
    """Lasers refined on all points: each point to its nearest line, each line through its points.

    Args:
        rho, z, scan: (n,) as in `find_lasers`.
        lines: (k, 2) initial elevations [rad] and centres [m].
        blur: (n,) standard errors of elevations by rounding [rad].
        rounds: of assigning and fitting.
    """
    lines = lines[np.argsort(-lines[:, 0])]
    half = half_width_rad(blur)
    for _ in range(rounds):
        which, off = nearest_laser(rho, z, lines)
        usual_m = _usual_centres(lines[:, 1])
        for row in range(len(lines)):
            own = np.flatnonzero((which == row) & (np.abs(off) < half))
            if len(own) >= _LEAST_POINTS:
                start = _with_centre(lines[row], usual_m[row], rho[own])
                lines[row] = _robust_line(rho[own], z[own], blur[own], start)
    which, off = nearest_laser(rho, z, lines)
    return _described(lines, which, off, scan, blur)


def _usual_centres(centre_m: np.ndarray) -> np.ndarray:
    """(k,) median centres of the lasers about each one."""
    first = np.clip(np.arange(len(centre_m)) - _LIKE_NEIGHBOURS // 2, 0, max(len(centre_m) - _LIKE_NEIGHBOURS, 0))
    return np.array([np.median(centre_m[at : at + _LIKE_NEIGHBOURS]) for at in first])


def _with_centre(line: np.ndarray, centre_m: float, rho: np.ndarray) -> np.ndarray:
    """The line with another centre [m] that meets a line (2,) at the usual distance of points (n,) from the axis."""
    height = line[1] - centre_m
    return np.array([np.arctan(np.tan(line[0]) + height / float(np.median(rho))), centre_m])


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


def _peel(rho: np.ndarray, z: np.ndarray, blur: np.ndarray, centres: np.ndarray, known: Lasers) -> np.ndarray:
    """Lines (k, 2) through points (n,), the strongest first.

    Args:
        rho, z: of the points.
        blur: (n,) standard errors of their elevations by rounding [rad].
        centres: heights of optical centres to try [m].
        known: lasers whose points are not among these.
    """
    if len(rho) < _LEAST_POINTS:
        return np.zeros((0, 2))
    half = half_width_rad(blur)
    width = 3 + 2 * int(np.degrees(blur.max()) / _CELL_DEG)  # cells of a peak
    votes = _votes(rho, z, centres)
    lines: list[np.ndarray] = list(known.lines)
    counts: list[int] = known.points.tolist()
    least, given = _NEAR_SHARE if len(known) else _LEAST_SHARE, len(lines)
    refused = 0
    while len(lines) < _MOST_LASERS and len(rho) >= _LEAST_POINTS and refused < 20:
        summed = np.cumsum(votes, 1)
        height = summed[:, width:] - summed[:, :-width]  # of the cells after each
        row, cell = np.unravel_index(int(height.argmax()), height.shape)
        peak = int(height[row, cell])
        floor = max(_LEAST_POINTS, least * float(np.median(counts)) if counts else 0.0)
        if peak < floor:
            break
        elevation = np.radians(_LOWEST_DEG + (cell + 1 + width / 2) * _CELL_DEG)
        guess = np.array([elevation, centres[row]])
        strip = np.flatnonzero(np.abs(np.arctan2(z - guess[1], rho) - elevation) < half)
        line = _robust_line(rho[strip], z[strip], blur[strip], guess) if len(strip) >= _LEAST_POINTS else guess
        own = np.abs(np.arctan2(z - line[1], rho) - line[0]) < half
        own[strip] |= np.abs(np.arctan2(z[strip] - guess[1], rho[strip]) - elevation) < np.radians(2 * _CELL_DEG)
        if _is_new(line, lines) and _stands_out(votes[row], int(cell) + 1 + width // 2, peak / width):
            lines.append(line)
            counts.append(int(own.sum()))
        else:
            refused += 1
        votes -= _votes(rho[own], z[own], centres)
        rho, z, blur, half = rho[~own], z[~own], blur[~own], half[~own]
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


def _is_new(line: np.ndarray, lines: list[np.ndarray]) -> bool:
    """Whether a line is none of some others, ten metres away."""
    if not lines:
        return True
    known = np.array(lines)
    apart = np.abs(known[:, 1] - line[1] + _AT_M * (np.tan(known[:, 0]) - np.tan(line[0]))) / _AT_M
    return bool(np.degrees(apart.min()) > _SAME_DEG)


def _stands_out(row: np.ndarray, cell: int, peak: float) -> bool:
    """Whether the mean votes of the cells of a peak are many times those of usual cells about it."""
    half = round(_BACKGROUND_DEG / _CELL_DEG)
    about = row[max(cell - half, 0) : cell + half + 1]
    return peak > _ABOVE_BACKGROUND * float(np.quantile(about, 0.3))


def _robust_line(rho: np.ndarray, z: np.ndarray, blur: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Elevation [rad] and centre [m] of the line through points: weighted least squares in the angle, no outliers.

    If all points are at similar ranges, the centre cannot be determined and is not changed.
    """
    elevation, centre = float(start[0]), float(start[1])
    for _ in range(4):
        off = np.arctan2(z - centre, rho) - elevation
        middle = float(np.median(off))
        spread = max(1.4826 * float(np.median(np.abs(off - middle))), 1e-5)
        good = np.abs(off - middle) < 3 * np.maximum(spread, blur)
        weight = 1 / (spread**2 + blur[good] ** 2)
        lever = np.cos(elevation) ** 2 / rho[good]  # how the angle changes with the centre
        level = lever - float(np.average(lever, weights=weight))
        heights = len(np.unique(z[good])) / max(int(good.sum()), 1)  # equal heights have the same error
        known = heights * float(weight @ level**2)
        raised = float((weight * level) @ off[good]) / float(weight @ level**2) if known * 0.005**2 > 1 else 0.0
        raised = float(np.clip(raised, -0.05, 0.05))
        centre = float(np.clip(centre + raised, _CENTRES_M[0], _CENTRES_M[-1]))
        elevation += float(np.average(off[good] - raised * lever, weights=weight))
    return np.array([elevation, centre])


def _described(lines: np.ndarray, which: np.ndarray, off: np.ndarray, scan: np.ndarray, blur: np.ndarray) -> Lasers:
    count = len(lines)
    on = np.abs(off) < half_width_rad(blur)
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
