"""Replays a sensor's effects on a sample of beams without tracing again.

A beam that is bent a little meets the same plane at another point: R = n·(p − o)/(n·d). Away from edges this is
exact, so that any effect can be tried in milliseconds; what moves is carried along its path.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.data.observation import upwards
from cosim.discrepancy.forward.ray_origins import leaving
from sensors.beams import Beams
from sensors.effects.acting import Streams, act_on_beams
from sensors.effects.base import BeamEffect, Effect
from sensors.effects.ring_elevation import RingElevation
from sensors.hits import NOTHING, Hits, Surface
from sensors.motion import yaw_matrices
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


class FrameReplay:
    """Some beams of one traced frame.

    Args:
        frame: the frame.
        beams: (n,) rows of its beams, sorted.
        measured: what beams beside them returned, see `Shot.beside`.

    Attributes:
        ego: the vehicle at the pose time.
        nominal: the beams as the pattern has them.
        is_calibrated: whether points stand where the unit's own calibration has its lasers look.
        solid, met: the surface that each meets, and its plane.
        pane_beam, pane, paned: (k,) rows of beams that pass a pane first, the panes, and their planes.
        paint, table: of `Hits`.
        along_m: (n,) what was measured along the beams [m]; NaN where nothing returned.
        unsure: (n,) each, how far the twin's ranges [m] and reflectances may be off.
        measured: see above.
    """

    def __init__(self, frame: TracedFrame, beams: np.ndarray, measured: Mapping[str, np.ndarray] | None = None) -> None:
        self._shot, self.ego, self._rows = frame.shot, frame.ego, beams
        self.nominal = _rows(frame.observed.rays, beams)
        self.is_calibrated = frame.observed.recovered
        self.along_m = frame.observed.along_m[beams].astype(np.float64)
        self.unsure = (frame.unsure_m[beams].astype(np.float64), frame.unsure_intensity[beams].astype(np.float64))
        hits = frame.shot.hits
        self.solid = hits.solid.take(beams)
        self.met = Planes.of(frame, beams, self.solid)
        behind = np.isin(hits.pane_beam, beams)
        self.pane = hits.pane.take(np.flatnonzero(behind))
        self.pane_beam = np.searchsorted(beams, hits.pane_beam[behind]).astype(np.int32)
        self.paned = Planes.of(frame, hits.pane_beam[behind], self.pane)
        self.paint, self.table = hits.paint, hits.table
        self.measured = measured
        self._last: tuple[tuple[Effect, ...], Shot] | None = None
        self._looks: tuple[tuple[Effect, ...], np.ndarray] | None = None
        self._found: dict[str, Any] = {}

    @property
    def pose(self) -> np.ndarray:
        """(4, 4) nominal world pose of the LiDAR."""
        assert self._shot.world is not None  # frames are traced
        return self._shot.world.pose

    @property
    def instances(self) -> Instances:
        """What moves in the frame."""
        assert self._shot.world is not None  # frames are traced
        return self._shot.world.instances

    @property
    def pattern(self) -> Pattern:
        """Of the beams."""
        return self._shot.pattern

    def looks(self, effects: Sequence[Effect]) -> np.ndarray | None:
        """Where the unit's own calibration has its lasers look, (n, 3) float64, where points stand along these.

        None where they stand along the beams of the pattern.
        """
        if not self.is_calibrated:
            return None
        known = tuple(effect for effect in effects if isinstance(effect, RingElevation))
        if self._looks is None or self._looks[0] != known:
            self._looks = (known, self._left(known).direction.astype(np.float64))
        return self._looks[1]

    def ranges(self, effects: Sequence[Effect], along_m: np.ndarray, above_m: np.ndarray) -> np.ndarray:
        """Distances (n,) of points, said along and above their beams, from the reported optical centres."""
        rays = self.shot(effects).rays
        origin = rays.origin.astype(np.float64)
        along = along_m - np.einsum("ij,ij->i", origin, rays.direction)
        return np.hypot(along, above_m - np.einsum("ij,ij->i", origin, upwards(rays.direction)))

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

    def shot(self, effects: Sequence[Effect]) -> Shot:
        """The sample as beams bent by the beam effects among `effects` meet it."""
        bending = tuple(effect for effect in effects if isinstance(effect, BeamEffect))
        if self._last is None or self._last[0] != bending:
            self._last = (bending, self._bent(bending))
        return self._last[1]

    def _left(self, effects: tuple[Effect, ...]) -> Beams:
        """The sample's beams as beam effects let them leave."""
        whole = self._shot
        before = Shot(whole.pattern, self.nominal, world=whole.world, frame_time_s=whole.frame_time_s, whole=whole)
        streams = Streams(np.random.default_rng(0))
        return act_on_beams(effects, Beams.nominal(self.nominal), before, streams, "replayed")

    def _bent(self, effects: tuple[Effect, ...]) -> Shot:
        pattern, world, pose = self._shot.pattern, self._shot.world, self.pose
        time_s = self._shot.frame_time_s
        beams = self._left(effects)
        one = np.zeros(len(beams.rays), int)
        origin, direction, firing_s = leaving(beams, [self.ego], [pose], one)
        solid = reached(self.solid, self.met.ranges(origin, direction, firing_s))
        rows = self.pane_beam
        pane = reached(self.pane, self.paned.ranges(origin[rows], direction[rows], firing_s[rows]))
        hits = Hits(beams.rays, pose, solid, rows, pane, self.paint, self.table)
        moving = (
            (origin - pose[:3, 3]).astype(np.float32),
            direction.astype(np.float32),
            firing_s.astype(np.float32),
        )
        return Shot(
            pattern,
            beams.rays,
            beams=beams,
            traced=Traced(hits, moving),
            world=world,
            frame_time_s=time_s,
            measured=self.measured,
            whole=self._shot,
            rows=self._rows,
            found=self._found,
        )


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
