"""What was measured, beam by beam."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.settings import DEFAULT, Beams
from cosim.drives.kitti import Drive, Frame, PointRays
from cosim.errors import DriveError
from sensors.pattern import Pattern
from sensors.rays import Rays

_BYTE = 255.0


@dataclass(frozen=True, eq=False)
class Observed:
    """The first return of every beam of a scan.

    Attributes:
        rays: the n beams.
        along_m: (n,) float32 component of the point along its beam's nominal direction, from the sensor's origin;
            NaN where nothing returned.
        above_m: (n,) float32 its component across, upwards; 0 for sensors with one optical centre.
        intensity: (n,) float32; NaN where nothing returned or the drive has none.
        trusted: (n,) bool: beams that may be compared.
        points: rows of the scan that are in it.
        strays: points that fit no beam of the pattern, left out.
        bad: points with NaN or infinity, left out.
        row: (n,) int64 row of the scan's point; −1 where nothing returned.
        recovered: whether beams were told from the order of the points: then these have their measured azimuths,
            and points stand where the unit's own calibration puts them.
    """

    rays: Rays
    along_m: np.ndarray
    above_m: np.ndarray
    intensity: np.ndarray
    trusted: np.ndarray
    points: int
    strays: int
    bad: int
    row: np.ndarray
    recovered: bool = False

    @property
    def returned(self) -> np.ndarray:
        """(n,) bool: whether the beam has a return."""
        return ~np.isnan(self.along_m)

    def range_from(self, origin: np.ndarray) -> np.ndarray:
        """Measured ranges (n,) from reported optical centres (n, 3) in LiDAR axes."""
        along = self.along_m - np.einsum("ij,ij->i", origin, self.rays.direction)
        return np.hypot(along, self.rise_from(origin)) if self.recovered else along

    def rise_from(self, origin: np.ndarray) -> np.ndarray:
        """How far points stand above their beams (n,) [m], if these leave from `origin` (n, 3)."""
        return self.above_m - np.einsum("ij,ij->i", origin, upwards(self.rays.direction))


def intensity_unit(drive: Drive, settings: Beams = DEFAULT.beams) -> float:
    """By what intensities of a drive are divided to be 0–1: 1, or 255 where they are bytes, as its first scans tell.

    Raises:
        DriveError: they reach beyond a byte.
    """
    for name in drive.frames[: settings.first_scans]:
        intensity = drive[name].points[:, 3]
        told = intensity[np.isfinite(intensity)]
        bright = float(np.quantile(told, settings.most_points)) if len(told) else 0.0
        if bright > _BYTE:
            raise DriveError(
                f"{drive.root}: intensities in velodyne/ reach {told.max():g}, but are 0–1 or bytes, 0–255; divide them"
            )
        if bright > settings.brightest:
            return _BYTE
    return 1.0


def observe(frame: Frame, pattern: Pattern, rays: Rays, unit: float = 1.0, settings: Beams = DEFAULT.beams) -> Observed:
    """Sort the points of a frame onto the beams of a pattern by ring and azimuth.

    Args:
        frame: with points; rings and azimuths are recovered where it has no `rays/`.
        pattern: of the sensor.
        rays: of the pattern.
        unit: by what intensities are divided, see `intensity_unit`.
        settings: numbers that decide.
    """
    points, of = frame.points, frame.rays
    row, fits = _beams(of, pattern, settings.half_slot)
    first, taken = np.unique(row[fits], return_index=True)
    used = np.flatnonzero(fits)[taken]

    xyz = points[used, :3].astype(np.float64)
    unfired = np.zeros(0, np.int64)
    if of.recovered:
        rays = _turned(rays, first, np.arctan2(xyz[:, 1], xyz[:, 0]))
    else:
        said = of.azimuth[used].astype(np.float64)
        aside = np.abs(np.angle(np.exp(1j * (said - rays.azimuth[first])))) > settings.aside_rad
        if aside.any():
            rays = _turned(rays, first[aside], said[aside])
            unfired = _unfired(rays, first, settings.at_once * 2 * np.pi / pattern.firings)
    direction = rays.direction[first].astype(np.float64)
    along = np.full(len(rays), np.nan, np.float32)
    above, intensity = along.copy(), along.copy()
    along[first] = np.einsum("ij,ij->i", xyz, direction)
    above[first] = np.einsum("ij,ij->i", xyz, upwards(direction))
    if frame.has_intensity:
        intensity[first] = points[used, 3] / np.float32(unit)
    row_of = np.full(len(rays), -1, np.int64)
    row_of[first] = used
    seconds = int(np.count_nonzero(of.return_no))
    trusted = np.ones(len(rays), bool)
    trusted[unfired] = False
    if frame.bad_points and (lost := frame.bad_rays) is not None:
        beam, told = _beams(lost, pattern, settings.half_slot)
        trusted[beam[told]] = False  # it returned, nobody knows from where
    return Observed(
        rays=rays,
        along_m=along,
        above_m=above,
        intensity=intensity,
        trusted=trusted,
        points=len(points),
        strays=len(points) - seconds - len(used),
        bad=frame.bad_points,
        row=row_of,
        recovered=of.recovered,
    )


def _beams(of: PointRays, pattern: Pattern, half_slot: float) -> tuple[np.ndarray, np.ndarray]:
    """Row (m,) of each point's beam, and whether the point fits one (m,): first returns near a firing's azimuth."""
    step = 2 * np.pi / pattern.firings
    ring = of.ring.astype(np.int64)
    known = ring < pattern.rings
    fan = np.radians(np.array(pattern.azimuth_offset_deg, float))[np.minimum(ring, pattern.rings - 1)]
    place = (np.pi - (of.azimuth.astype(np.float64) - fan)) / step - 0.5
    slot = np.rint(place)
    fits = known & (np.abs(place - slot) < half_slot) & (of.return_no == 0)
    return ring * pattern.firings + slot.astype(np.int64) % pattern.firings, fits


def _unfired(rays: Rays, rows: np.ndarray, at_once_rad: float) -> np.ndarray:
    """Beams between two returns of a ring that follow each other at once: a head that turns unevenly skips slots.

    Args:
        rays: of the pattern, those with returns turned to measured azimuths.
        rows: (k,) which these are, rising.
        at_once_rad: between returns that follow each other at once.
    """
    after = np.roll(rows, -1)
    apart = np.angle(np.exp(1j * (rays.azimuth[rows].astype(float) - rays.azimuth[after])))
    between = after - rows - 1
    at_once = (rays.ring[rows] == rays.ring[after]) & (np.abs(apart) < at_once_rad)
    start = rows[at_once & (between > 0)]
    count = between[at_once & (between > 0)]
    return np.repeat(start + 1, count) + np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)


def _turned(rays: Rays, rows: np.ndarray, azimuth: np.ndarray) -> Rays:
    """Rays of which some (k,) look to measured azimuths (k,), their elevations unchanged."""
    direction, nominal = rays.direction.copy(), rays.azimuth.copy()
    flat = np.hypot(direction[rows, 0], direction[rows, 1])
    direction[rows, 0], direction[rows, 1] = flat * np.cos(azimuth), flat * np.sin(azimuth)
    nominal[rows] = azimuth
    return Rays(rays.origin, direction, rays.ring, nominal, rays.time_s)


def upwards(direction: np.ndarray) -> np.ndarray:
    """Unit vectors (n, 3) across `direction` (n, 3), in its vertical plane, upwards."""
    flat = np.maximum(np.hypot(direction[:, 0], direction[:, 1]), 1e-9)
    rise = direction[:, 2]
    return np.stack([-rise * direction[:, 0] / flat, -rise * direction[:, 1] / flat, flat], 1)
