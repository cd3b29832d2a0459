"""Measured − expected range of every point: the twin traced as `cosim compare` traces it."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from cosim.drives.kitti import Drive
from cosim.view.objects import NO_MATERIAL, ON_SURFACE_M
from sensors.effects.base import Effect
from sensors.sensor_model import SensorModel

if TYPE_CHECKING:
    from cosim.discrepancy.data.frames import FrameTracer


@dataclass(frozen=True, eq=False)
class PointResiduals:
    """Residuals of the points of a frame for a sensor model.

    Attributes:
        metres: (n,) measured − expected range [m]; NaN if the point matches no beam or its beam hits no surface.
        material: (n,) uint8 index in `materials` of the surface that the point's beam hits; `NO_MATERIAL` for none.
        materials: names of the materials.
    """

    metres: np.ndarray
    material: np.ndarray
    materials: tuple[str, ...]


class ResidualTracer:
    """Traces the frames of a drive with a sensor model; the twin is read when the first frame is traced.

    Args:
        drive: drive with points and a twin.
        sensor: sensor model.
    """

    def __init__(self, drive: Drive, sensor: SensorModel) -> None:
        self._drive, self._sensor = drive, sensor
        self._one_at_a_time = threading.Lock()

    def trace(self, name: str) -> PointResiduals:
        """Compute the residuals of a frame; thread-safe.

        Raises:
            DriveError: the twin does not match the drive.
            CosimError: a part of the frame is damaged or does not exist.
        """
        with self._one_at_a_time:
            return self._trace(name)

    @cached_property
    def _tracer(self) -> FrameTracer:
        from cosim.discrepancy.data.checks import check_fit, opened
        from cosim.discrepancy.data.frames import FrameTracer

        tracer = FrameTracer(opened(self._drive), self._sensor)
        check_fit(tracer.trace(self._drive.frames[0], self._bending), self._drive)
        return tracer

    @cached_property
    def _effects(self) -> tuple[Effect, ...]:
        from sensors.effects.acting import in_order

        return in_order(self._sensor.effects)

    @cached_property
    def _bending(self) -> tuple[Effect, ...]:
        from sensors.effects.acting import bending

        return bending(self._effects)

    def _trace(self, name: str) -> PointResiduals:
        from sensors.effects.expectation import expect

        traced = self._tracer.trace(name, self._bending)
        observed, shot = traced.observed, traced.shot
        expected = expect(self._effects, shot).range_m  # chance left out, as on the page of `cosim compare`
        by_beam = observed.range_from(shot.rays.origin) - expected
        beams = np.flatnonzero(observed.row >= 0)
        rows = observed.row[beams]
        metres = np.full(observed.points, np.nan)
        metres[rows] = np.where(observed.trusted[beams], by_beam[beams], np.nan)
        solid = shot.hits.solid
        material = np.full(observed.points, NO_MATERIAL, np.uint8)
        with np.errstate(invalid="ignore"):
            on_it = np.abs(by_beam[beams]) < ON_SURFACE_M
        material[rows] = np.where(on_it, solid.material[beams], NO_MATERIAL)
        return PointResiduals(metres, material, tuple(shot.hits.table.names))
