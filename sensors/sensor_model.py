"""A sensor: a beam pattern and the effects that make it real."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import yaml

from sensors.beams import Beams
from sensors.camera_view import CameraView
from sensors.effects.acting import Streams, act_on_beams, act_on_boxes, act_on_returns
from sensors.effects.base import BeamEffect, Effect, LabelEffect
from sensors.errors import SensorError
from sensors.hits import Hits
from sensors.label_boxes import LabelBoxes
from sensors.motion import EgoMotion
from sensors.pattern import Pattern
from sensors.point_cloud import PointCloud, bare_returns, scaled
from sensors.rays import Rays
from sensors.returns import Returns
from sensors.scene import Instances, Scene
from sensors.shot import Shot
from sensors.world import Traced, TracerCache, World


@dataclass(frozen=True)
class SensorModel:
    """A LiDAR.

    Attributes:
        pattern: its beams.
        effects: its physics; they act in the order of their phases.
        origin: where it was read, for messages.
    """

    pattern: Pattern
    effects: tuple[Effect, ...] = ()
    origin: str = ""

    @property
    def needs_new_rays(self) -> bool:
        """Whether stored hits are not sufficient: `trace_and_measure` is then used instead of `measure`."""
        return any(effect.needs_new_rays for effect in self.effects)

    @property
    def needs_camera(self) -> bool:
        """Whether an effect takes its light from the frame's grayscale image, where that is at hand."""
        return any(effect.needs_camera for effect in self.effects)

    @property
    def relabels(self) -> bool:
        """Whether an effect changes the labels."""
        return any(isinstance(effect, LabelEffect) for effect in self.effects)

    def measure(
        self,
        hits: Hits,
        rng: np.random.Generator | None = None,
        camera: CameraView | None = None,
        frame_time_s: float = 0.0,
    ) -> PointCloud:
        """The points it reports of traced hits.

        Args:
            hits: of this pattern's nominal beams.
            rng: for effects that draw; the same generator gives the same points.
            camera: what the grayscale camera saw.
            frame_time_s: pose time of the frame.

        Raises:
            SensorError: an effect needs new rays, or a user's effect breaks the rules.
        """
        if not self.effects:
            return bare_returns(hits)
        returns, shot = self.measure_returns(hits, rng, camera, frame_time_s)
        return points_of(returns, shot)

    def measure_returns(
        self,
        hits: Hits,
        rng: np.random.Generator | None = None,
        camera: CameraView | None = None,
        frame_time_s: float = 0.0,
    ) -> tuple[Returns, Shot]:
        """The returns that `measure` converts to points, with the beam of each."""
        new = [effect.name for effect in self.effects if effect.needs_new_rays]
        if new:
            raise SensorError(f"sensor {self.origin}: {', '.join(new)} cannot be made from stored hits; trace again")
        shot = Shot(self.pattern, hits.rays, traced=Traced(hits), camera=camera, frame_time_s=frame_time_s)
        return self.returns_of(shot, rng), shot

    def trace_and_measure(
        self,
        scene: Scene,
        pose: np.ndarray,
        instances: Instances,
        ego: EgoMotion,
        rng: np.random.Generator | None = None,
        camera: CameraView | None = None,
        frame_time_s: float = 0.0,
    ) -> PointCloud:
        """The points it reports of a scene, traced with its true beams.

        Args:
            scene: what there is.
            pose: (4, 4) nominal world pose of the LiDAR at the pose time.
            instances: what moves, at the pose time.
            ego: the vehicle that carries the LiDAR, and its motion.
            rng: for effects that draw.
            camera: what the grayscale camera saw.
            frame_time_s: pose time of the frame.

        Raises:
            SensorError: a user's effect breaks the rules.
        """
        returns, shot = self.trace_returns(scene, pose, instances, ego, rng, camera, frame_time_s)
        return points_of(returns, shot)

    def trace_returns(
        self,
        scene: Scene,
        pose: np.ndarray,
        instances: Instances,
        ego: EgoMotion,
        rng: np.random.Generator | None = None,
        camera: CameraView | None = None,
        frame_time_s: float = 0.0,
    ) -> tuple[Returns, Shot]:
        """The returns that `trace_and_measure` converts to points, with the beam of each."""
        given = _given(rng)
        shot = self.trace(scene, pose, instances, ego, deepcopy(given), camera, frame_time_s)
        return self.returns_of(shot, given), shot

    def trace(
        self,
        scene: Scene,
        pose: np.ndarray,
        instances: Instances,
        ego: EgoMotion,
        rng: np.random.Generator | None = None,
        camera: CameraView | None = None,
        frame_time_s: float = 0.0,
    ) -> Shot:
        """One revolution of its true beams at a pose time, before anything is measured.

        Sensors that differ in other than their pattern and beam effects may get their `returns_of` the same shot.
        """
        world = World(scene, pose, instances, ego, self.pattern.range_m, self._tracers)
        streams = Streams(_given(rng))
        before = Shot(self.pattern, self._rays, world=world, frame_time_s=frame_time_s)
        beams = act_on_beams(self._ordered, Beams.nominal(self._rays), before, streams, self.origin)
        traced = world.trace(beams)
        return Shot(
            self.pattern,
            beams.rays,
            beams=beams,
            traced=traced,
            world=world,
            camera=camera,
            frame_time_s=frame_time_s,
        )

    def returns_of(
        self, shot: Shot, rng: np.random.Generator | None = None, memo: dict[tuple[str, ...], Returns] | None = None
    ) -> Returns:
        """Returns of a traced revolution.

        Args:
            shot: traced with the sensor's own pattern and beam effects; with its world if effects need new rays.
            rng: generator in the state in which it was passed to `trace`.
            memo: cache shared by sensors that measure one shot with equal generators, so that effects that are first
                in all of them are applied once.
        """
        return act_on_returns(self._ordered, shot.solids, shot, Streams(_given(rng)), self.origin, memo)

    def with_annotator(self, effects: Sequence[LabelEffect]) -> SensorModel:
        """Return the sensor whose scans an annotator labels.

        Args:
            effects: label effects of the annotator.

        Raises:
            SensorError: the sensor changes labels already.
        """
        if effects and self.relabels:
            raise SensorError(
                f"sensor {self.origin} has label effects already; remove them, or set `labels: {{annotator: exact}}`"
            )
        return replace(self, effects=(*self.effects, *effects))

    def relabel(self, boxes: LabelBoxes, rng: np.random.Generator | None = None) -> LabelBoxes:
        """The labelled boxes after its label effects."""
        return act_on_boxes(self._ordered, boxes, Streams(_given(rng)), self.origin)

    @property
    def beam_effects(self) -> tuple[BeamEffect, ...]:
        """The effects that change the directions of the beams, in the order of their phases."""
        return tuple(effect for effect in self._ordered if isinstance(effect, BeamEffect))

    def to_yaml(self) -> str:
        """The sensor file; it names the pattern, which is stored next to it."""
        effects = [{"effect": e.source or e.name, **e.model_dump(mode="json")} for e in self.effects]
        values = {"pattern": self.pattern.name, "effects": effects}
        return yaml.safe_dump(values, sort_keys=False, allow_unicode=True, width=110)

    @cached_property
    def _ordered(self) -> tuple[Effect, ...]:
        return tuple(sorted(self.effects, key=lambda effect: effect.phase))

    @cached_property
    def _rays(self) -> Rays:
        return self.pattern.rays()

    @cached_property
    def _tracers(self) -> TracerCache:
        return TracerCache(self.pattern.range_m)


def load_sensor(name_or_path: str | Path) -> SensorModel:
    """A sensor from its file, a built-in one by name, or a bare one from the name of a pattern.

    Raises:
        SensorError: no such file, sensor or pattern; an unknown key or effect; a parameter out of bounds.
    """
    from sensors.sensor_file import read_sensor

    return read_sensor(str(name_or_path))


def _given(rng: np.random.Generator | None) -> np.random.Generator:
    return np.random.default_rng(0) if rng is None else rng


def points_of(returns: Returns, shot: Shot) -> PointCloud:
    """Points at the reported optical centre + measured range × nominal direction, on the grid of coordinates."""
    beam, rays = returns.beam, shot.rays
    xyz = scaled(rays.direction.take(beam, axis=0), returns.range_m)
    xyz += rays.origin.take(beam, axis=0)
    if step_m := shot.pattern.coordinate_step_m:
        xyz = (np.rint(xyz.astype(np.float64) / step_m) * step_m).astype(np.float32)
    return PointCloud(
        xyz=xyz,
        intensity=returns.intensity.astype(np.float32),
        ring=rays.ring.take(beam),
        azimuth=rays.azimuth.take(beam),
        time_s=rays.time_s.take(beam),
        return_no=returns.return_no,
        instance=returns.instance,
        material=returns.material,
    )
