"""Points corrected for known effects of the sensor: maps are made from them.

For effects that rotate or shift beams the true beam of every point is known; the measured range is applied along it.
Range biases that depend only on laser or intensity are subtracted, evaluated at the measured range and intensity.
Biases that depend on the surface, noise, rounding and losses remain. The sensor's own motion in a sweep is corrected
with the poses of the map, see `build_map`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.recordings.mapping.motion import scan_times
from cosim.recordings.pattern.find import beams_of
from cosim.recordings.recording import Recording
from cosim.recordings.scan import Scan
from sensors.beams import Beams
from sensors.effects.acting import Streams, act_on_beams
from sensors.effects.base import BeamEffect, Effect
from sensors.effects.beams.dual_block import DualBlock
from sensors.effects.beams.sweep_motion import SweepMotion
from sensors.effects.points.range_bias import RangeBias
from sensors.effects.points.range_walk import RangeWalk
from sensors.effects.points.ring_range_offset import RingRangeOffset
from sensors.effects.registry import effect_classes
from sensors.hits import STATIC
from sensors.pattern import Pattern
from sensors.rays import Rays
from sensors.returns import Returns
from sensors.shot import Shot

_OF_RANGES = (RangeBias, RangeWalk, RingRangeOffset)


def moves_points(name: str) -> bool:
    """Whether undoing an effect of the catalogue changes where points of a map come to lie."""
    kind = effect_classes().get(name)
    return kind is not None and issubclass(kind, (BeamEffect, *_OF_RANGES)) and kind is not DualBlock


@dataclass(frozen=True, eq=False)
class CorrectedRecording(Recording):
    """A recording whose scans are changed as they are read.

    Attributes:
        change: what is done to each.
    """

    change: Callable[[Scan], Scan] = lambda scan: scan

    def __getitem__(self, number: int) -> Scan:
        """Read and change a scan."""
        return self.change(super().__getitem__(number))


@dataclass(frozen=True, eq=False)
class Correction:
    """Undoes effects of points that lie on beams of a pattern.

    Attributes:
        pattern: of the sensor.
        lines: (k, 2) elevations and centres of the lasers that points show, see `Lasers.lines`.
        ring_of: (k,) ring of the pattern that each is.
        effects: all that are known of the sensor.
    """

    pattern: Pattern
    lines: np.ndarray
    ring_of: np.ndarray
    effects: tuple[Effect, ...]

    @property
    def is_needed(self) -> bool:
        """Whether any of the effects moves points."""
        return any(moves_points(one.name) for one in self.effects)

    def sweep_scale(self) -> float | None:
        """Share of a sweep that `sweep_motion` says the sensor moves in; None where that effect is not there."""
        own = [one.sweep_s for one in self.effects if isinstance(one, SweepMotion)]
        return own[0] / self.pattern.sweep_s if own else None

    def of(self, recording: Recording) -> Recording:
        """The recording with these effects undone."""
        if not self.is_needed:
            return recording
        own = {name: getattr(recording, name) for name in Recording.__dataclass_fields__}
        return CorrectedRecording(**own, change=self.undone)

    def undone(self, scan: Scan) -> Scan:
        """A scan with the effects undone; points on no beam are left as they are."""
        which = beams_of(scan, self.lines)
        rows = np.flatnonzero(which >= 0)
        if not len(rows):
            return scan
        xyz, light = scan.xyz[rows], None if scan.intensity is None else scan.intensity[rows]
        time_s = scan_times(scan.azimuth_rad, scan.time_s, self.pattern.sweep_s)[rows]
        rays = _nominal(xyz, self.ring_of[which[rows]], time_s, self.pattern)
        shot = Shot(self.pattern, rays)
        beams = act_on_beams(self.effects, Beams.nominal(rays), shot, Streams(np.random.default_rng(0)), "corrected")
        range_m = np.linalg.norm(xyz - beams.rays.origin, axis=1)
        bias = _range_bias(self.effects, range_m, light, Shot(self.pattern, beams.rays))
        moved = beams.origin - beams.rays.origin
        turned = (range_m - bias)[:, None] * beams.direction - range_m[:, None] * beams.rays.direction
        found = scan.xyz.copy()
        found[rows] = xyz + moved + turned
        return replace(scan, xyz=found)


def _nominal(xyz: np.ndarray, ring: np.ndarray, time_s: np.ndarray, pattern: Pattern) -> Rays:
    """The beams of points (n, 3): of their rings' elevations, of their own azimuths."""
    elevation = np.radians(np.array(pattern.elevation_deg))[ring]
    azimuth = np.arctan2(xyz[:, 1], xyz[:, 0])
    flat = np.cos(elevation)
    direction = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], 1)
    return Rays(
        origin=np.zeros((len(xyz), 3), np.float32),
        direction=direction.astype(np.float32),
        ring=ring.astype(np.uint8),
        azimuth=azimuth.astype(np.float32),
        time_s=time_s.astype(np.float32),
    )


def _range_bias(effects: Sequence[Effect], range_m: np.ndarray, light: np.ndarray | None, shot: Shot) -> np.ndarray:
    """(n,) how much too long ranges are."""
    count = len(range_m)
    bright = np.zeros(count, np.float32) if light is None else light.astype(np.float32)
    plain = Returns(
        beam=np.arange(count, dtype=np.int32),
        range_m=range_m.astype(np.float32),
        intensity=bright,
        reflectance=bright,
        normal_code=np.zeros((count, 2), np.int16),
        material=np.zeros(count, np.uint8),
        instance=np.full(count, STATIC, np.int16),
        return_no=np.zeros(count, np.uint8),
    )
    found = np.zeros(count)
    for effect in effects:
        if isinstance(effect, _OF_RANGES):
            found += effect.apply(plain, shot, np.random.default_rng(0)).range_m - plain.range_m
    return found
