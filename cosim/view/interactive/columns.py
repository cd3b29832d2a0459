"""Columns of values for the points of a frame, and reasons for missing columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.drives.kitti import Drive, Frame
from cosim.errors import FormatError
from cosim.view.interactive.packing import PackedColumn, quantised
from cosim.view.interactive.residual import PointResiduals
from cosim.view.objects import Objects, PointInstances, find_instances

STEP_M = 0.005
RESIDUAL_STEP_M = 0.001
_INTENSITY_STEP = 1 / 255
_NO_OBJECTS = "objects are unknown: there are neither labels nor a twin"
_NO_MATERIAL = "materials are unknown: there are neither stored hits nor a twin"


@dataclass(frozen=True, eq=False)
class PointColumns:
    """The columns of a frame.

    Attributes:
        columns: x, y, z and further available columns.
        absent: colour mode → reason why it is not available.
        materials: names of the numbers in the column `material`.
        met: object of every point.
    """

    columns: list[PackedColumn]
    absent: dict[str, str]
    materials: tuple[str, ...]
    met: PointInstances


def point_columns(
    drive: Drive, frame: Frame, objects: Objects, residuals: PointResiduals | None, why_not: str
) -> PointColumns:
    """Gather the columns of a frame.

    Args:
        drive, frame: drive and frame of the points.
        objects: objects of the frame.
        residuals: residuals of the points, if the twin was traced.
        why_not: reason why the twin was not traced.

    Raises:
        CosimError: a part of the frame is damaged.
    """
    points = frame.points
    columns = [quantised(name, points[:, axis], STEP_M, "delta") for axis, name in enumerate("xyz")]
    absent: dict[str, str] = {}
    if frame.has_intensity:
        columns.append(PackedColumn("intensity", _byte(points[:, 3] / _INTENSITY_STEP), _INTENSITY_STEP))
    else:
        absent["intensity"] = "the scan has no intensities"
    _add_ring(frame, columns, absent)
    met = find_instances(drive, frame, objects)
    if met.source == "none":
        absent["instance"] = _NO_OBJECTS
    else:
        columns.append(quantised("instance", met.number, 1))
    material, materials = met.material, met.materials
    if material is None and residuals is not None:
        material, materials = residuals.material, residuals.materials
    if material is None:
        absent["material"] = _NO_MATERIAL
    else:
        columns.append(PackedColumn("material", material))
    if residuals is None:
        absent["residual"] = why_not
    else:
        columns.append(residual_column(residuals))
    return PointColumns(columns, absent, materials, met)


def residual_column(residuals: PointResiduals) -> PackedColumn:
    """Column of residuals in steps of one millimetre."""
    return quantised("residual", residuals.metres, RESIDUAL_STEP_M)


def _byte(values: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def _add_ring(frame: Frame, columns: list[PackedColumn], absent: dict[str, str]) -> None:
    try:
        columns.append(PackedColumn("ring", frame.rays.ring))
    except FormatError as error:
        if frame.has("rays"):
            raise
        absent["ring"] = str(error)
