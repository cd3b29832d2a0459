"""Replays a sensor's effects on a sample of beams without tracing again.

A beam that is bent a little meets the same plane at another point: R = n·(p − o)/(n·d). Away from edges this is
exact, so that any effect can be tried in milliseconds; what moves is carried along its path.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from assets.materials import MaterialTable
from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.data.observation import upwards
from sensors.beams import Beams
from sensors.effects.acting import Streams, act_on_beams
from sensors.effects.base import BeamEffect, Effect, ScanEffect
from sensors.effects.beams.ring_elevation import RingElevation
from sensors.effects.expectation import Expectation, expect, spurious_density
from sensors.hits import NOTHING, Hits, Surface
from sensors.motion import EgoMotion, yaw_matrices
from sensors.pattern import Pattern
from sensors.rays import Rays
from sensors.scene import Instances
from sensors.shot import Shot
from sensors.world import Traced

_GRAZING = 1e-3
_NEARLY_ALL = 0.97  # a laser or two that see next to nothing may be bent anywhere


@dataclass(frozen=True, eq=False)
class Planes:
    """The planes that beams meet, at the pose time, and how they move.

    Attributes:
        point: (n, 3) float64 world.
        normal: (n, 3) float64 world, unit.
        velocity_mps: (n, 3) of what they belong to.
        yaw_rate_radps: (n,).
        centre: (n, 3) what it turns about.
    """

    point: np.ndarray
    normal: np.ndarray
    velocity_mps: np.ndarray
    yaw_rate_radps: np.ndarray
    centre: np.ndarray

    @classmethod
    def of(cls, frame: TracedFrame, beam: np.ndarray, surface: Surface) -> Planes:
        """Those of `surface` (n rows), met by `beam` (n,) of a traced frame."""
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
        return planes if not time_s.any() else planes._carried(-time_s, point - time_s[:, None] * velocity)

    def at(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points and normals (n, 3) at instants (n,)."""
        if not time_s.any():
            return self.point, self.normal
        moved = self._carried(time_s, self.point)
        return moved.point + time_s[:, None] * self.velocity_mps, moved.normal

    def _carried(self, time_s: np.ndarray, point: np.ndarray) -> Planes:
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
        """Where rays (n) meet them, (n,) float64; NaN behind the ray or along the plane."""
        point, normal = self.at(time_s)
        slope = np.einsum("ij,ij->i", normal, direction)
        height = np.einsum("ij,ij->i", normal, point - origin)
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = height / slope
        return np.where((np.abs(slope) > _GRAZING) & (reach > 0), reach, np.nan)


@dataclass(frozen=True, eq=False)
class Expected:
    """What effects let expect of n beams.

    Attributes:
        of: means, spreads and probabilities.
        along_m, above_m: (n,) how far the reported optical centre stands along and above each beam [m].
        stray, split: (n,) density [1/m] of returns from elsewhere at the measured range, and what other parts of the
            beam itself have of it; 0 where nothing was measured.
    """

    of: Expectation
    along_m: np.ndarray
    above_m: np.ndarray
    stray: np.ndarray
    split: np.ndarray


class Replayed:
    """Some beams, and what they meet as effects bend them; shots bent in the latest few ways are kept.

    Attributes:
        nominal: the beams as the pattern has them.
        is_calibrated: whether points stand where the unit's own calibration has its lasers look.
        along_m: (n,) what was measured along the beams [m]; NaN where nothing returned.
        unsure: (n,) each, how far the twin's ranges [m] and reflectances may be off.
        solid, met: the surface that each meets, and its plane.
        pane_beam, pane, paned: (k,) rows of beams that pass a pane first, the panes, and their planes.
        paint, table: of `Hits`.
        measured: what beams beside them returned, see `Shot.beside`.
        egos, poses: of each frame, the vehicle at the pose time and the nominal world pose of the LiDAR (4, 4).
        frame: (n,) int row of each beam's frame.
    """

    ways = 1
    nominal: Rays
    is_calibrated: bool
    along_m: np.ndarray
    unsure: tuple[np.ndarray, np.ndarray]
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
        self._shots: list[tuple[tuple[Effect, ...], Shot]] = []
        self._looks: tuple[tuple[Effect, ...], np.ndarray] | None = None

    def expect(self, effects: tuple[Effect, ...]) -> Expected:
        """What effects, in the order in which they act, let expect."""
        shot = self.shot(effects)
        return self.completed(effects, shot, expect(effects, shot, self.unsure))

    def completed(self, effects: tuple[Effect, ...], shot: Shot, found: Expectation) -> Expected:
        """An expectation of a shot, with where its optical centres stand and returns from elsewhere."""
        looks = self._looked(effects)
        direction = shot.rays.direction
        upward, along, above = shot.kept("optical centres", lambda: _centres(shot.rays))
        stray, split = np.zeros(len(self.along_m)), np.zeros(len(self.along_m))
        if looks is not None:
            # Points stand where the unit's calibration has its lasers look, not along the pattern's beams; how far
            # above these follows from the measured range, whatever surface it was.
            ahead = np.einsum("ij,ij->i", looks, direction)
            above = above + (self.along_m - along) / ahead * np.einsum("ij,ij->i", looks, upward)
            reach = np.nan_to_num(found.range_m)  # a beam into the sky may return all the same: of a drop, at its range
            along = along + reach * (ahead - 1)
        rows = np.flatnonzero(~np.isnan(self.along_m))
        for effect in effects:
            if type(effect).density is not Effect.density:
                density = spurious_density(effect, rows, self.along_m[rows] - along[rows], shot)
                stray[rows] += density
                split[rows] += 0.0 if isinstance(effect, ScanEffect) else density
        return Expected(found, along, above, stray, split)

    def shot(self, effects: Sequence[Effect]) -> Shot:
        """The beams as those bent by the beam effects among `effects` meet what they do."""
        bending = tuple(effect for effect in effects if isinstance(effect, BeamEffect))
        kept = next((shot for known, shot in self._shots if known == bending), None)
        if kept is None:
            kept = self._bent(bending)
            self._shots = [*self._shots, (bending, kept)][-self.ways :]
        return kept

    def _looked(self, effects: Sequence[Effect]) -> np.ndarray | None:
        """Where the unit's own calibration has its lasers look, (n, 3) float64, where points stand along these.

        None where they stand along the beams of the pattern.
        """
        if not self.is_calibrated:
            return None
        known = tuple(effect for effect in effects if isinstance(effect, RingElevation))
        if self._looks is None or self._looks[0] != known:
            self._looks = (known, self._left(known).direction.astype(np.float64))
        return self._looks[1]

    def _left(self, effects: tuple[Effect, ...]) -> Beams:
        """The beams as beam effects let them leave."""
        streams = Streams(np.random.default_rng(0))
        return act_on_beams(effects, Beams.nominal(self.nominal), self._unbent(), streams, "", self._met)

    def _bent(self, effects: tuple[Effect, ...]) -> Shot:
        return self._met(self._left(effects))

    def _met(self, beams: Beams) -> Shot:
        """Beams as they meet the planes of their surfaces."""
        origin, direction, time_s = _ray_origins(beams, self.egos, self.poses, self.frame)
        solid = reached(self.solid, self.met.ranges(origin, direction, time_s))
        rows = self.pane_beam
        pane = reached(self.pane, self.paned.ranges(origin[rows], direction[rows], time_s[rows]))
        moving = origin, direction.astype(np.float32), time_s.astype(np.float32)
        return self._answered(beams, solid, pane, moving)

    def _unbent(self) -> Shot:
        """The beams before they are traced."""
        raise NotImplementedError

    def _answered(
        self, beams: Beams, solid: Surface, pane: Surface, moving: tuple[np.ndarray, np.ndarray, np.ndarray]
    ) -> Shot:
        """Beams that met some surfaces, leaving as they are `moving`: from, whither and when, (n, …) world axes."""
        raise NotImplementedError


class FrameReplay(Replayed):
    """Some beams of one traced frame.

    Args:
        frame: the frame.
        beams: (n,) rows of its beams.
        measured: what beams beside them returned, see `Shot.beside`.
        met: (n,) rows of the beams whose surfaces they meet, where that are not their own.
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
        self.unsure = (frame.unsure_m[beams].astype(np.float64), frame.unsure_intensity[beams].astype(np.float64))
        hits, traced, whose = frame.shot.hits, frame.shot.traced, beams if met is None else met
        assert traced is not None  # frames are traced
        self._rows, self.solid = whose, hits.solid.take(whose)
        self.met = Planes.of(frame, whose, self.solid)
        if met is not None:
            time_s = np.broadcast_to(traced.time_s, len(frame.shot.rays))[beams].astype(np.float64)
            ranges = self.met.ranges(traced.origin[beams], traced.direction[beams].astype(np.float64), time_s)
            self.solid = reached(self.solid, np.where(met == beams, self.solid.range_m, ranges))
        pane = np.full(len(frame.shot.rays), -1)
        pane[hits.pane_beam] = np.arange(len(hits.pane_beam))
        own = (pane[beams] >= 0) & (whose == beams)  # a plane of glass goes no farther than its pane
        self.pane_beam = np.flatnonzero(own).astype(np.int32)
        self.pane = hits.pane.take(pane[beams[own]])
        self.paned = Planes.of(frame, beams[own], self.pane)
        self.paint, self.table = hits.paint, hits.table
        self.measured = measured
        self.egos, self.poses, self.frame = (frame.ego,), (self._world.pose,), np.zeros(len(beams), int)
        self._found: dict[str, Any] = {}

    @property
    def instances(self) -> Instances:
        """What moves in the frame."""
        return self._world.instances

    @property
    def pattern(self) -> Pattern:
        """Of the beams."""
        return self._shot.pattern

    def ranges(self, effects: Sequence[Effect], along_m: np.ndarray, above_m: np.ndarray) -> np.ndarray:
        """Distances (n,) of points, said along and above their beams, from the reported optical centres."""
        _, along, above = _centres(self.shot(effects).rays)
        return np.hypot(along_m - along, above_m - above)

    def moved(self, effects: Sequence[Effect], used: np.ndarray) -> tuple[float, float]:
        """How far effects turn [rad] and shift [m] nearly all of the beams used (n,) from where they were traced."""
        now, then, rows = self.shot(effects).traced, self._shot.traced, self._rows
        assert now is not None and then is not None  # frames are traced
        turn = np.linalg.norm(now.direction - then.direction[rows], axis=1)
        shift = np.linalg.norm(now.origin - then.origin[rows], axis=1)
        later = now.time_s - np.broadcast_to(then.time_s, len(self._shot.rays))[rows]
        shift += np.abs(later) * np.linalg.norm(self.met.velocity_mps, axis=1)
        if not np.any(used):
            return 0.0, 0.0
        return float(np.quantile(turn[used], _NEARLY_ALL)), float(np.quantile(shift[used], _NEARLY_ALL))

    def _unbent(self) -> Shot:
        whole = self._shot
        return Shot(whole.pattern, self.nominal, world=whole.world, frame_time_s=whole.frame_time_s, whole=whole)

    def _answered(
        self, beams: Beams, solid: Surface, pane: Surface, moving: tuple[np.ndarray, np.ndarray, np.ndarray]
    ) -> Shot:
        pose, (origin, direction, time_s) = self._world.pose, moving
        hits = Hits(beams.rays, pose, solid, self.pane_beam, pane, self.paint, self.table)
        return Shot(
            self._shot.pattern,
            beams.rays,
            beams=beams,
            traced=Traced(hits, ((origin - pose[:3, 3]).astype(np.float32), direction, time_s)),
            world=self._world,
            frame_time_s=self._shot.frame_time_s,
            measured=self.measured,
            whole=self._shot,
            rows=self._rows,
            found=self._found,
        )


def _ray_origins(
    beams: Beams, egos: Sequence[EgoMotion], lidar_poses: Sequence[np.ndarray], frame: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """True optical centres and directions, (n, 3) float64 world axes, and instants (n,) [s] from the pose time.

    Args:
        beams: of one frame or several, as effects left them.
        egos: the vehicle at the pose time of each frame.
        lidar_poses: (4, 4) nominal world poses of the LiDAR at the pose times.
        frame: (n,) int row of each beam's frame.
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
    place = np.stack([ego.pose[:3, 3] for ego in egos])
    turn = sensor[frame, :3, :3]
    direction = np.einsum("nij,nj->ni", turn, beams.direction)
    arm = np.einsum("nij,nj->ni", turn, beams.origin) + (sensor[:, :3, 3] - place)[frame]
    origin = place[frame] + arm
    if time_s.any():
        onward = yaw_matrices(np.array([ego.yaw_rate_radps for ego in egos])[frame] * time_s)
        direction = np.einsum("nij,nj->ni", onward, direction)
        velocity = np.stack([np.asarray(ego.velocity_mps, float) for ego in egos])
        origin = place[frame] + time_s[:, None] * velocity[frame] + np.einsum("nij,nj->ni", onward, arm)
    return origin, direction, time_s


def _centres(rays: Rays) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which way is up (n, 3), and how far optical centres stand along and above the beams, (n,) each [m]."""
    origin, upward = rays.origin.astype(np.float64), upwards(rays.direction)
    return upward, np.einsum("ij,ij->i", origin, rays.direction), np.einsum("ij,ij->i", origin, upward)


def reached(met: Surface, ranges: np.ndarray) -> Surface:
    """Surfaces (n,) at other ranges (n,); nothing where these are not finite."""
    there = np.isfinite(ranges) & (met.instance != NOTHING)
    return Surface(
        range_m=np.where(there, ranges, np.inf).astype(np.float32),
        normal_code=met.normal_code,
        material=met.material,
        instance=np.where(there, met.instance, met.instance.dtype.type(NOTHING)),
    )


def _rows(rays: Rays, rows: np.ndarray) -> Rays:
    return Rays(*(getattr(rays, field.name)[rows] for field in fields(Rays)))
