"""Make the frames of several variants from one source frame, tracing each set of beams only once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cosim.drives.kitti.labels import DONT_CARE, format_labels
from cosim.drives.kitti.points import encode_points
from cosim.drives.kitti.rays import PointRays, encode_rays
from cosim.labels.effects import EXACT, difficulties, relabelled
from cosim.variants.request import Variant
from cosim.variants.source import SourceFrame, VariantSource
from sensors.effects.base import Effect, LabelEffect
from sensors.point_cloud import PointCloud
from sensors.returns import Returns
from sensors.sensor_model import SensorModel, points_of
from sensors.shot import Shot
from sensors.world import Traced

LABEL_DECIMALS = 4


@dataclass(frozen=True)
class VariantFrame:
    """One frame of one variant.

    Attributes:
        files: file contents by path.
        counts: numbers of points, of labels, and of labels by difficulty.
    """

    files: dict[str, bytes]
    counts: dict[str, int]


class Maker:
    """Makes the frames of variants of one drive.

    Args:
        source: source drive.
        variants: variants to make.
    """

    def __init__(self, source: VariantSource, variants: Sequence[Variant]) -> None:
        self._source = source
        self._variants = {variant.stem: variant for variant in variants}

    def make(self, name: str, stems: Sequence[str]) -> dict[str, VariantFrame]:
        """Make a frame for the given variants, by stem; the bytes depend only on the drive and the sensor.

        Raises:
            CosimError: a part of the drive does not exist or is damaged.
            SensorError: a user-defined effect returns invalid results.
        """
        frame = SourceFrame(self._source, name)
        work = _FrameWork(self._source, frame)
        return {stem: work.variant(self._variants[stem].sensor) for stem in stems}


class _FrameWork:
    """Cache for the variants of one frame: traced shots by beam effects, scans by sensor, ray files by returns."""

    def __init__(self, source: VariantSource, frame: SourceFrame) -> None:
        self._source = source
        self._frame = frame
        self._shots: dict[object, Shot] = {}
        self._memos: dict[int, dict[tuple[str, ...], Returns]] = {}
        self._clouds: dict[object, PointCloud] = {}
        self._ray_files: list[tuple[PointCloud, bytes]] = []

    def variant(self, sensor: SensorModel) -> VariantFrame:
        """Simulate the frame with a sensor, including its labels."""
        name = self._frame.name
        cloud = self._cloud(sensor)
        exact = self._frame.frame.exact_labels
        files = {f"velodyne/{name}.bin": encode_points(cloud.kitti), f"rays/{name}.npz": self._rays(cloud)}
        labels = exact
        if sensor.relabels:
            rng, calibration = self._source.rng(name), self._frame.frame.calibration
            labels = relabelled(exact, sensor, cloud.xyz, calibration, rng)
            files[f"{EXACT}/{name}.txt"] = self._exact_file
        files[f"label_2/{name}.txt"] = format_labels(labels, LABEL_DECIMALS).encode()
        if self._source.drive.lidar:
            files[f"twin/frames/{name}.json"] = self._frame.frame.twin.to_json().encode()
        count = sum(kind != DONT_CARE for kind in labels.type)
        return VariantFrame(files, {"points": len(cloud), "labels": count, **difficulties(labels)})

    @cached_property
    def _exact_file(self) -> bytes:
        return format_labels(self._frame.frame.exact_labels, LABEL_DECIMALS).encode()

    def _cloud(self, sensor: SensorModel) -> PointCloud:
        key = sensor.pattern, _effect_keys(effect for effect in sensor.effects if not isinstance(effect, LabelEffect))
        if key not in self._clouds:
            shot = self._shot(sensor)
            memo = self._memos.setdefault(id(shot), {})
            returns = sensor.returns_of(shot, self._source.rng(self._frame.name), memo)
            self._clouds[key] = points_of(returns, shot).in_file_order()
        return self._clouds[key]

    def _shot(self, sensor: SensorModel) -> Shot:
        """Hits of the sensor's beams: stored hits if the beams are the same, else traced in the twin."""
        frame = self._frame
        use_stored = sensor.pattern == self._source.pattern and not sensor.needs_new_rays
        key = "stored" if use_stored else (sensor.pattern, _effect_keys(sensor.beam_effects))
        if key not in self._shots:
            camera = frame.camera
            if use_stored:
                traced = Traced(frame.hits)
                shot = Shot(sensor.pattern, frame.hits.rays, traced=traced, camera=camera, frame_time_s=frame.time_s)
            else:
                rng = self._source.rng(frame.name)
                shot = sensor.trace(
                    frame.scene, frame.lidar_pose, frame.instances, frame.ego, rng, camera, frame.time_s
                )
            self._shots[key] = shot
        return self._shots[key]

    def _rays(self, cloud: PointCloud) -> bytes:
        """File of the points' rays; sensors with the same returns share it."""
        for other, data in self._ray_files:
            if all(np.array_equal(getattr(cloud, part), getattr(other, part)) for part in _RAY_PARTS):
                return data
        data = encode_rays(PointRays(*(getattr(cloud, part) for part in _RAY_PARTS)))
        self._ray_files.append((cloud, data))
        return data


def _effect_keys(effects: Iterable[Effect]) -> tuple[str, ...]:
    return tuple(f"{effect.source or effect.name} {effect.model_dump_json()}" for effect in effects)


_RAY_PARTS = ("ring", "azimuth", "time_s", "return_no")
