"""Assignment of the measured points of a scan to the beams of a sensor pattern."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.settings import DEFAULT, BeamSampling
from cosim.drives.kitti import Drive, Frame, PointRays
from cosim.errors import DriveError
from sensors.pattern import Pattern
from sensors.rays import Rays

_BYTE = 255.0


@dataclass(frozen=True, eq=False)
class Observed:
    """The first return of every beam of a scan.

    Attributes:
        rays: nominal rays of the n beams, LiDAR axes.
        along_m: (n,) float32 component of the point along its beam's nominal direction, from the sensor's origin;
            NaN without a return [m].
        above_m: (n,) float32 component perpendicular to the beam, upwards [m]; 0 for sensors with one optical centre.
        intensity: (n,) float32 from 0 to 1; NaN without a return or without intensities.
        trusted: (n,) bool beams that can be compared.
        points: number of points of the scan.
        unmatched: number of points that fit no beam of the pattern; they are skipped.
        bad: number of points with NaN or infinity; they are skipped.
        row: (n,) int32 row of the beam's point in the scan; −1 without a return.
        recovered: whether beams were identified from the order of the points. Then rays have measured azimuths, and
            points follow the unit's own calibration instead of the pattern.
    """

    rays: Rays
    along_m: np.ndarray
    above_m: np.ndarray
    intensity: np.ndarray
    trusted: np.ndarray
    points: int
    unmatched: int
    bad: int
    row: np.ndarray
    recovered: bool = False

    @property
    def returned(self) -> np.ndarray:
        """(n,) bool whether the beam has a return."""
        return ~np.isnan(self.along_m)

    def range_from(self, origin: np.ndarray) -> np.ndarray:
        """Measured ranges (n,) [m] from reported optical centres (n, 3) [m] in LiDAR axes."""
        along = self.along_m - np.einsum("ij,ij->i", origin, self.rays.direction)
        return np.hypot(along, self.rise_from(origin)) if self.recovered else along

    def rise_from(self, origin: np.ndarray) -> np.ndarray:
        """Offsets (n,) [m] of the points perpendicular to beams from `origin` (n, 3), upwards."""
        return self.above_m - np.einsum("ij,ij->i", origin, upwards(self.rays.direction))


def intensity_unit(drive: Drive, settings: BeamSampling = DEFAULT.beams) -> float:
    """Determine from the first scans the divisor that scales intensities to 0–1: 1, or 255 for bytes.

    Raises:
        DriveError: intensities exceed 255.
    """
    for name in drive.frames[: settings.first_scans]:
        intensity = drive[name].points[:, 3]
        finite = intensity[np.isfinite(intensity)]
        high = float(np.quantile(finite, settings.most_points)) if len(finite) else 0.0
        if high > _BYTE:
            raise DriveError(
                f"{drive.root}: intensities in velodyne/ reach {finite.max():g}, but must be 0–1 or 0–255; divide them"
            )
        if high > settings.brightest:
            return _BYTE
    return 1.0


def observe(
    frame: Frame, pattern: Pattern, rays: Rays, unit: float = 1.0, settings: BeamSampling = DEFAULT.beams
) -> Observed:
    """Assign the points of a frame to the beams of a pattern by ring and azimuth.

    Args:
        frame: frame with points; rings and azimuths are recovered from the points if it has no `rays/`.
        pattern: pattern of the sensor.
        rays: nominal rays of the pattern.
        unit: divisor of intensities, see `intensity_unit`.
        settings: settings of the assignment.
    """
    points, of = frame.points, frame.rays
    row, fits = _assign_beams(of, pattern, settings.half_slot)
    first, taken = np.unique(row[fits], return_index=True)
    used = np.flatnonzero(fits)[taken]

    xyz = points[used, :3].astype(np.float64)
    unfired = np.zeros(0, np.int64)
    if of.recovered:
        rays = _with_azimuths(rays, first, np.arctan2(xyz[:, 1], xyz[:, 0]))
    else:
        azimuth = of.azimuth[used].astype(np.float64)
        aside = np.abs(np.angle(np.exp(1j * (azimuth - rays.azimuth[first])))) > settings.aside_rad
        if aside.any():
            rays = _with_azimuths(rays, first[aside], azimuth[aside])
            unfired = _find_unfired(rays, first, settings.at_once * 2 * np.pi / pattern.firings)
    direction = rays.direction[first].astype(np.float64)
    along = np.full(len(rays), np.nan, np.float32)
    above, intensity = along.copy(), along.copy()
    along[first] = np.einsum("ij,ij->i", xyz, direction)
    above[first] = np.einsum("ij,ij->i", xyz, upwards(direction))
    if frame.has_intensity:
        intensity[first] = points[used, 3] / np.float32(unit)
    row_of = np.full(len(rays), -1, np.int32)
    row_of[first] = used
    seconds = int(np.count_nonzero(of.return_no))
    trusted = np.ones(len(rays), bool)
    trusted[unfired] = False
    if frame.bad_points and (bad_rays := frame.bad_rays) is not None:
        beam, fits_beam = _assign_beams(bad_rays, pattern, settings.half_slot)
        trusted[beam[fits_beam]] = False  # these beams had a return at an unknown range
    return Observed(
        rays=rays,
        along_m=along,
        above_m=above,
        intensity=intensity,
        trusted=trusted,
        points=len(points),
        unmatched=len(points) - seconds - len(used),
        bad=frame.bad_points,
        row=row_of,
        recovered=of.recovered,
    )


def _assign_beams(of: PointRays, pattern: Pattern, half_slot: float) -> tuple[np.ndarray, np.ndarray]:
    """Beam (m,) of each point, and mask (m,) of points that fit one: first returns close to a firing's azimuth."""
    step = 2 * np.pi / pattern.firings
    ring = of.ring.astype(np.int64)
    known = ring < pattern.rings
    fan = np.radians(np.array(pattern.azimuth_offset_deg, float))[np.minimum(ring, pattern.rings - 1)]
    position = (np.pi - (of.azimuth.astype(np.float64) - fan)) / step - 0.5
    slot = np.rint(position)
    fits = known & (np.abs(position - slot) < half_slot) & (of.return_no == 0)
    return ring * pattern.firings + slot.astype(np.int64) % pattern.firings, fits


def _find_unfired(rays: Rays, rows: np.ndarray, at_once_rad: float) -> np.ndarray:
    """Find beams of the pattern that were not fired: a head with uneven rotation speed skips azimuth slots.

    Args:
        rays: rays of the pattern; those with returns have measured azimuths.
        rows: (k,) ascending rows of the beams with returns.
        at_once_rad: maximum azimuth difference of returns from consecutive firings [rad].
    """
    after = np.roll(rows, -1)
    apart = np.angle(np.exp(1j * (rays.azimuth[rows].astype(float) - rays.azimuth[after])))
    between = after - rows - 1
    at_once = (rays.ring[rows] == rays.ring[after]) & (np.abs(apart) < at_once_rad)
    start = rows[at_once & (between > 0)]
    count = between[at_once & (between > 0)]
    return np.repeat(start + 1, count) + np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)


def _with_azimuths(rays: Rays, rows: np.ndarray, azimuth: np.ndarray) -> Rays:
    """Return rays with new azimuths (k,) [rad] for some rows (k,); elevations are unchanged."""
    direction, nominal = rays.direction.copy(), rays.azimuth.copy()
    flat = np.hypot(direction[rows, 0], direction[rows, 1])
    direction[rows, 0], direction[rows, 1] = flat * np.cos(azimuth), flat * np.sin(azimuth)
    nominal[rows] = azimuth
    return Rays(rays.origin, direction, rays.ring, nominal, rays.time_s)


def upwards(direction: np.ndarray) -> np.ndarray:
    """Unit vectors (n, 3) perpendicular to `direction` (n, 3), in its vertical plane, upwards."""
    flat = np.maximum(np.hypot(direction[:, 0], direction[:, 1]), 1e-9)
    rise = direction[:, 2]
    return np.stack([-rise * direction[:, 0] / flat, -rise * direction[:, 1] / flat, flat], 1)
