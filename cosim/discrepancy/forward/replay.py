"""Replay of a sensor's effects on a sample of beams without ray casting.

A slightly deflected beam hits the same plane at another point: R = n·(p − o)/(n·d). Away from edges this is exact, so
that an effect is evaluated in milliseconds. Moving objects are moved to the firing time.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

import numpy as np
from scipy import special

from assets.materials import MaterialTable
from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.data.observation import upwards
from sensors.beams import Beams
from sensors.effects.acting import Streams, act_on_beams
from sensors.effects.base import BeamEffect, EchoEffect, Effect, ScanEffect
from sensors.effects.beams.ring_elevation import RingElevation
from sensors.effects.expectation import Expectation, ExpectationMemo, expect, spurious_density
from sensors.hits import NOTHING, Hits, Surface
from sensors.motion import EgoMotion, yaw_matrices
from sensors.pattern import Pattern
from sensors.rays import Rays
from sensors.scene import Instances
from sensors.shot import Shot
from sensors.world import Traced

_GRAZING = 1e-3
_REFLECTANCE_STEP = 0.02  # relative, of finite differences
_LEAST_CHANCE = 1e-6
_NEARLY_ALL = 0.97  # quantile: a few lasers without returns may be deflected arbitrarily


@dataclass(frozen=True, eq=False)
class Planes:
    """Planes that the beams hit, at the pose time, and their motion; world frame.

    Attributes:
        point: (n, 3) float64 point of the plane [m].
        normal: (n, 3) float64 unit normal.
        velocity_mps: (n, 3) velocity of the object that it belongs to [m/s].
        yaw_rate_radps: (n,) yaw rate of the object [rad/s].
        centre: (n, 3) centre of rotation of the object [m].
    """

    point: np.ndarray
    normal: np.ndarray
    velocity_mps: np.ndarray
    yaw_rate_radps: np.ndarray
    centre: np.ndarray

    @classmethod
    def of(cls, frame: TracedFrame, beam: np.ndarray, surface: Surface) -> Planes:
        """Planes of the surfaces (n rows) that beams (n,) of a traced frame hit."""
        traced, instances = frame.shot.traced, frame.instances
        assert traced is not None  # frames are traced
        met = np.where(surface.instance == NOTHING, 0.0, surface.range_m)
        point = traced.origin[beam] + traced.direction[beam].astype(np.float64) * met[:, None]
        normal = surface.normal.astype(np.float64)
        time_s = np.broadcast_to(traced.time_s, len(frame.shot.rays))[beam].astype(np.float64)
        moves = surface.instance >= 0
        row = np.maximum(surface.instance, 0)
        count = len(beam)
        velocity, rate, centre = np.zeros((count, 3)), np.zeros(count), np.zeros((count, 3))
        if len(instances):
            velocity[moves] = instances.velocity_mps[row[moves]]
            rate[moves] = instances.yaw_rate_radps[row[moves]]
            centre[moves] = instances.poses[row[moves], :3, 3]
        planes = cls(point, normal, velocity, rate, centre)
        return planes if not time_s.any() else planes._moved_by(-time_s, point - time_s[:, None] * velocity)

    def at(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points and normals (n, 3) at times (n,) [s] from the pose time."""
        if not time_s.any():
            return self.point, self.normal
        moved = self._moved_by(time_s, self.point)
        return moved.point + time_s[:, None] * self.velocity_mps, moved.normal

    def _moved_by(self, time_s: np.ndarray, point: np.ndarray) -> Planes:
        turns = np.flatnonzero(self.yaw_rate_radps * time_s)
        if not len(turns):
            return Planes(point, self.normal, self.velocity_mps, self.yaw_rate_radps, self.centre)
        point, normal = point.copy(), self.normal.copy()
        matrix = yaw_matrices(self.yaw_rate_radps[turns] * time_s[turns])
        arm = point[turns] - self.centre[turns]
        point[turns] = self.centre[turns] + np.einsum("nij,nj->ni", matrix, arm)
        normal[turns] = np.einsum("nij,nj->ni", matrix, normal[turns])
        return Planes(point, normal, self.velocity_mps, self.yaw_rate_radps, self.centre)

    def ranges(self, origin: np.ndarray, direction: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Ranges (n,) float64 [m] at which n rays hit the planes; NaN behind the ray or parallel to the plane."""
        point, normal = self.at(time_s)
        slope = np.einsum("ij,ij->i", normal, direction)
        height = np.einsum("ij,ij->i", normal, point - origin)
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = height / slope
        return np.where((np.abs(slope) > _GRAZING) & (reach > 0), reach, np.nan)


@dataclass(frozen=True, eq=False)
class Expected:
    """Prediction of n beams by effects.

    Attributes:
        of: means, standard deviations and probabilities.
        along_m, above_m: (n,) offset of the reported optical centre along and perpendicular to (above) each beam [m].
        spurious_per_m: (n,) density [1/m] of spurious returns at the measured range; 0 without a return.
        log_odds_by_reflectance: computes the derivative (n,) of the log-odds of `of.seen` with respect to the relative
            reflectance of the surface.
    """

    of: Expectation
    along_m: np.ndarray
    above_m: np.ndarray
    spurious_per_m: np.ndarray
    log_odds_by_reflectance: Callable[[], np.ndarray]


class Replayed:
    """Beams and the surfaces they hit if effects deflect them; the latest `ways` shots are cached.

    Attributes:
        ways: number of cached shots.
        nominal: nominal rays of the pattern.
        is_calibrated: whether points follow the unit's own laser calibration instead of the pattern.
        along_m: (n,) measured component along the beams [m]; NaN without a return.
        twin_sigmas: (n,) each, σ of the twin's ranges [m] and intensities.
        solid, met: the surface that each beam hits, and its plane.
        pane_beam, pane, paned: (k,) rows of beams that pass through glass first, the panes, and their planes.
        paint, table: as in `Hits`.
        measured: measurements of neighbouring beams, see `Shot.beside`.
        egos, poses: for each frame, motion of the vehicle at the pose time and nominal world pose (4, 4) of the LiDAR.
        frame: (n,) int index of each beam's frame.
    """

    ways = 1
    nominal: Rays
    is_calibrated: bool
    along_m: np.ndarray
    twin_sigmas: tuple[np.ndarray, np.ndarray]
    solid: Surface
    met: Planes
    pane_beam: np.ndarray
    pane: Surface
    paned: Planes
    paint: np.ndarray
    table: MaterialTable
    measured: Mapping[str, np.ndarray] | None
    egos: Sequence[EgoMotion]
    poses: Sequence[np.ndarray]
    frame: np.ndarray

    def __init__(self) -> None:
        self._shots: list[tuple[tuple[Effect, ...], Shot, ExpectationMemo]] = []
        self._slopes: list[tuple[tuple[Effect, ...], np.ndarray]] = []
        self._calibrated: tuple[tuple[Effect, ...], np.ndarray] | None = None

    def expect(self, effects: tuple[Effect, ...]) -> Expected:
        """Predict the beams from effects, given in the order in which they act."""
        shot, memo = self._shot_and_memo(effects)
        expectation = expect(effects, shot, self.twin_sigmas, memo=memo)
        return self._complete(effects, shot, expectation, lambda: self._log_odds(effects, shot, expectation.seen, memo))

    def complete(self, effects: tuple[Effect, ...], shot: Shot, expectation: Expectation) -> Expected:
        """Add optical centres and spurious returns to the expectation of a shot."""
        slope = cache(lambda: _log_odds_by_reflectance(effects, shot, expectation.seen, self.twin_sigmas))
        return self._complete(effects, shot, expectation, slope)

    def _complete(
        self,
        effects: tuple[Effect, ...],
        shot: Shot,
        expectation: Expectation,
        log_odds_by_reflectance: Callable[[], np.ndarray],
    ) -> Expected:
        lasers = self._calibrated_directions(effects)
        direction = shot.rays.direction
        upward, along, above = shot.kept("optical centres", lambda: _centres(shot.rays))
        spurious_per_m = np.zeros(len(self.along_m))
        if lasers is not None:
            # Points lie along the lasers of the unit's calibration, not along the pattern's beams; their offset from
            # these follows from the measured range for any surface.
            cosine = np.einsum("ij,ij->i", lasers, direction)
            above = above + (self.along_m - along) / cosine * np.einsum("ij,ij->i", lasers, upward)
            reach = np.nan_to_num(expectation.range_m)  # 0 without a surface: the return is from rain or fog then
            along = along + reach * (cosine - 1)
        rows = np.flatnonzero(~np.isnan(self.along_m))
        for effect in effects:
            if type(effect).density is not Effect.density:
                spurious_per_m[rows] += spurious_density(effect, rows, self.along_m[rows] - along[rows], shot)
        return Expected(expectation, along, above, spurious_per_m, log_odds_by_reflectance)

    def _log_odds(self, effects: tuple[Effect, ...], shot: Shot, seen: np.ndarray, memo: ExpectationMemo) -> np.ndarray:
        """As `Expected.log_odds_by_reflectance`; the same for all deflections of the beams: they change it little."""
        key = tuple(effect for effect in _detecting(effects) if not isinstance(effect, BeamEffect))
        slope = next((slope for detecting, slope in self._slopes if detecting == key), None)
        if slope is None:
            slope = _log_odds_by_reflectance(effects, shot, seen, self.twin_sigmas, memo)
            self._slopes = [*self._slopes, (key, slope)][-self.ways :]
        return slope

    def shot(self, effects: Sequence[Effect]) -> Shot:
        """Return the hits of the beams as deflected by the beam effects among `effects`."""
        return self._shot_and_memo(effects)[0]

    def _shot_and_memo(self, effects: Sequence[Effect]) -> tuple[Shot, ExpectationMemo]:
        """Shot as deflected by the beam effects among `effects`, and the memo of its expectations."""
        beam_effects = tuple(effect for effect in effects if isinstance(effect, BeamEffect))
        cached = next(((shot, memo) for key, shot, memo in self._shots if key == beam_effects), None)
        if cached is None:
            cached = self._deflected_shot(beam_effects), ExpectationMemo()
            self._shots = [*self._shots, (beam_effects, *cached)][-self.ways :]
        return cached

    def _calibrated_directions(self, effects: Sequence[Effect]) -> np.ndarray | None:
        """(n, 3) float64 directions of the lasers in the unit's own calibration.

        None if points lie along the beams of the pattern.
        """
        if not self.is_calibrated:
            return None
        known = tuple(effect for effect in effects if isinstance(effect, RingElevation))
        if self._calibrated is None or self._calibrated[0] != known:
            self._calibrated = (known, self._apply_beam_effects(known).direction.astype(np.float64))
        return self._calibrated[1]

    def _apply_beam_effects(self, effects: tuple[Effect, ...]) -> Beams:
        """Apply beam effects to the nominal beams."""
        streams = Streams(np.random.default_rng(0))
        return act_on_beams(effects, Beams.nominal(self.nominal), self._nominal_shot(), streams, "", self._intersect)

    def _deflected_shot(self, effects: tuple[Effect, ...]) -> Shot:
        return self._intersect(self._apply_beam_effects(effects))

    def _intersect(self, beams: Beams) -> Shot:
        """Intersect beams with the planes of their surfaces."""
        origin, direction, time_s = _world_rays(beams, self.egos, self.poses, self.frame)
        solid = with_ranges(self.solid, self.met.ranges(origin, direction, time_s))
        rows = self.pane_beam
        pane = with_ranges(self.pane, self.paned.ranges(origin[rows], direction[rows], time_s[rows]))
        moving = origin, direction.astype(np.float32), time_s.astype(np.float32)
        return self._build_shot(beams, solid, pane, moving)

    def _nominal_shot(self) -> Shot:
        """Return the shot of the nominal beams, without hits."""
        raise NotImplementedError

    def _build_shot(
        self, beams: Beams, solid: Surface, pane: Surface, moving: tuple[np.ndarray, np.ndarray, np.ndarray]
    ) -> Shot:
        """Build the shot of beams with hits; `moving` has origins [m], directions and times [s] (n, …), world axes."""
        raise NotImplementedError


class FrameReplay(Replayed):
    """Beams of one traced frame.

    Args:
        frame: traced frame.
        beams: (n,) rows of the beams.
        measured: measurements of neighbouring beams, see `Shot.beside`.
        met: (n,) rows of the beams whose surfaces they hit; default: their own.
    """

    def __init__(
        self,
        frame: TracedFrame,
        beams: np.ndarray,
        measured: Mapping[str, np.ndarray] | None = None,
        met: np.ndarray | None = None,
    ) -> None:
        super().__init__()
        assert frame.shot.world is not None  # frames are traced
        self._shot, self._world = frame.shot, frame.shot.world
        self.nominal = _rows(frame.observed.rays, beams)
        self.is_calibrated = frame.observed.recovered
        self.along_m = frame.observed.along_m[beams].astype(np.float64)
        self.twin_sigmas = (
            frame.twin_sigma_m[beams].astype(np.float64),
            frame.twin_sigma_intensity[beams].astype(np.float64),
        )
        hits, traced, whose = frame.shot.hits, frame.shot.traced, beams if met is None else met
        assert traced is not None  # frames are traced
        self._rows, self.solid = whose, hits.solid.take(whose)
        self.met = Planes.of(frame, whose, self.solid)
        if met is not None:
            time_s = np.broadcast_to(traced.time_s, len(frame.shot.rays))[beams].astype(np.float64)
            ranges = self.met.ranges(traced.origin[beams], traced.direction[beams].astype(np.float64), time_s)
            self.solid = with_ranges(self.solid, np.where(met == beams, self.solid.range_m, ranges))
        pane = np.full(len(frame.shot.rays), -1)
        pane[hits.pane_beam] = np.arange(len(hits.pane_beam))
        own = (pane[beams] >= 0) & (whose == beams)  # a pane is not extended beyond its own beam
        self.pane_beam = np.flatnonzero(own).astype(np.int32)
        self.pane = hits.pane.take(pane[beams[own]])
        self.paned = Planes.of(frame, beams[own], self.pane)
        self.paint, self.table = hits.paint, hits.table
        self.measured = measured
        self.egos, self.poses, self.frame = (frame.ego,), (self._world.pose,), np.zeros(len(beams), int)
        self._cache: dict[str, Any] = {}

    def with_reflectances(self, table: MaterialTable | None, paint: np.ndarray | None) -> FrameReplay:
        """The same beams with other materials, or other reflectances of the paint of the instances (m,)."""
        changed = copy.copy(self)
        changed.table = self.table if table is None else table
        changed.paint = self.paint if paint is None else paint.astype(np.float32)
        changed._shots, changed._slopes = [], []
        return changed

    @property
    def instances(self) -> Instances:
        """Objects of the frame."""
        return self._world.instances

    @property
    def is_texture_known(self) -> bool:
        """Whether the texture of the frame's surfaces is known, see `Shot`."""
        return self._shot.is_texture_known

    @property
    def pattern(self) -> Pattern:
        """Pattern of the beams."""
        return self._shot.pattern

    def ranges(self, effects: Sequence[Effect], along_m: np.ndarray, above_m: np.ndarray) -> np.ndarray:
        """Ranges (n,) [m] of points, given along and above their beams [m], from the reported optical centres."""
        _, along, above = _centres(self.shot(effects).rays)
        return np.hypot(along_m - along, above_m - above)

    def moved(self, effects: Sequence[Effect], used: np.ndarray) -> tuple[float, float]:
        """97 % quantiles of rotation [rad] and shift [m] by effects since tracing, over the beams `used` (n,)."""
        now, then, rows = self.shot(effects).traced, self._shot.traced, self._rows
        assert now is not None and then is not None  # frames are traced
        turn = np.linalg.norm(now.direction - then.direction[rows], axis=1)
        shift = np.linalg.norm(now.origin - then.origin[rows], axis=1)
        later = now.time_s - np.broadcast_to(then.time_s, len(self._shot.rays))[rows]
        shift += np.abs(later) * np.linalg.norm(self.met.velocity_mps, axis=1)
        if not np.any(used):
            return 0.0, 0.0
        return float(np.quantile(turn[used], _NEARLY_ALL)), float(np.quantile(shift[used], _NEARLY_ALL))

    def _nominal_shot(self) -> Shot:
        whole = self._shot
        return Shot(whole.pattern, self.nominal, world=whole.world, frame_time_s=whole.frame_time_s, whole=whole)

    def _build_shot(
        self, beams: Beams, solid: Surface, pane: Surface, moving: tuple[np.ndarray, np.ndarray, np.ndarray]
    ) -> Shot:
        pose, (origin, direction, time_s) = self._world.pose, moving
        hits = Hits(beams.rays, pose, solid, self.pane_beam, pane, self.paint, self.table)
        shot = Shot(
            self._shot.pattern,
            beams.rays,
            beams=beams,
            traced=Traced(hits, ((origin - pose[:3, 3]).astype(np.float32), direction, time_s)),
            world=self._world,
            frame_time_s=self._shot.frame_time_s,
            measured=self.measured,
            whole=self._shot,
            rows=self._rows,
            cache=self._cache,
        )
        shot.is_texture_known = self._shot.is_texture_known
        return shot


def _world_rays(
    beams: Beams, egos: Sequence[EgoMotion], lidar_poses: Sequence[np.ndarray], frame: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """True optical centres [m] and directions, (n, 3) float64 in world axes, and times (n,) [s] from the pose time.

    Args:
        beams: beams of one or several frames after effects.
        egos: motion of the vehicle at the pose time of each frame.
        lidar_poses: (4, 4) nominal world poses of the LiDAR at the pose times.
        frame: (n,) int index of each beam's frame.
    """
    time_s = np.full(len(beams.rays), beams.delay_s)
    if beams.firing_s is not None:
        time_s += beams.firing_s
    sensor = np.stack(
        [
            ego.pose @ beams.body @ np.linalg.solve(ego.pose, pose) @ beams.mount
            for ego, pose in zip(egos, lidar_poses, strict=True)
        ]
    )
    position = np.stack([ego.pose[:3, 3] for ego in egos])
    turn = sensor[frame, :3, :3]
    direction = np.einsum("nij,nj->ni", turn, beams.direction)
    arm = np.einsum("nij,nj->ni", turn, beams.origin) + (sensor[:, :3, 3] - position)[frame]
    origin = position[frame] + arm
    if time_s.any():
        onward = yaw_matrices(np.array([ego.yaw_rate_radps for ego in egos])[frame] * time_s)
        direction = np.einsum("nij,nj->ni", onward, direction)
        velocity = np.stack([np.asarray(ego.velocity_mps, float) for ego in egos])
        origin = position[frame] + time_s[:, None] * velocity[frame] + np.einsum("nij,nj->ni", onward, arm)
    return origin, direction, time_s


def _centres(rays: Rays) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Upward unit vectors (n, 3), and offsets (n,) [m] of optical centres along and above the beams."""
    origin, upward = rays.origin.astype(np.float64), upwards(rays.direction)
    return upward, np.einsum("ij,ij->i", origin, rays.direction), np.einsum("ij,ij->i", origin, upward)


def _detecting(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """The effects up to the last one that may change the probability of a return."""
    last = max((row for row, one in enumerate(effects, 1) if isinstance(one, EchoEffect | ScanEffect)), default=0)
    return tuple(effects[:last])


def _log_odds_by_reflectance(
    effects: tuple[Effect, ...],
    shot: Shot,
    seen: np.ndarray,
    twin_sigmas: tuple[np.ndarray, np.ndarray],
    memo: ExpectationMemo | None = None,
) -> np.ndarray:
    """Derivative (n,) of the log-odds of a return with respect to the relative reflectance, by a finite difference.

    Args:
        effects, shot: as of `expect`.
        seen: (n,) probability of a return with these reflectances.
        twin_sigmas, memo: as of `expect`.
    """
    slope = np.zeros(len(shot.rays))
    if not any(isinstance(effect, EchoEffect) for effect in effects):
        return slope
    noiseless = shot.noiseless
    darker = expect(_detecting(effects), shot, twin_sigmas, 1 - _REFLECTANCE_STEP, memo).seen
    shot.noiseless = noiseless
    least = np.minimum(seen, darker), 1 - np.maximum(seen, darker)
    rows = np.flatnonzero(np.minimum(*least) > _LEAST_CHANCE)
    slope[rows] = (special.logit(seen[rows]) - special.logit(darker[rows])) / _REFLECTANCE_STEP
    return slope


def with_ranges(met: Surface, ranges: np.ndarray) -> Surface:
    """Return surfaces (n,) with other ranges (n,) [m]; misses where these are not finite."""
    there = np.isfinite(ranges) & (met.instance != NOTHING)
    return Surface(
        range_m=np.where(there, ranges, np.inf).astype(np.float32),
        normal_code=met.normal_code,
        material=met.material,
        instance=np.where(there, met.instance, met.instance.dtype.type(NOTHING)),
        measured=met.measured,
    )


def _rows(rays: Rays, rows: np.ndarray) -> Rays:
    return Rays(*(getattr(rays, field.name)[rows] for field in fields(Rays)))
