"""A calibrated sensor in the calibration formats of drivers: Velodyne, Hesai, Ouster, ROS, NCore.

Velodyne: `calibration.yaml` of the ROS driver (ros-drivers/velodyne, velodyne_pointcloud). Hesai: the angle correction
file, `Channel,Elevation,Azimuth` in degrees (user manuals, appendix). Ouster: `beam_altitude_angles`,
`beam_azimuth_angles` and `lidar_origin_to_beam_origin_mm` of the sensor's metadata. NCore: elevations of rows, azimuth
offsets of rows and azimuths of columns [rad] of a structured spinning LiDAR.
"""

from __future__ import annotations

import csv
import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.optimize import linear_sum_assignment

from cosim.drives.files import read_text
from cosim.drives.writer import explained
from cosim.errors import CosimError
from sensors.beams import Beams
from sensors.effects.acting import Streams, act_on_beams, in_order
from sensors.effects.base import BeamEffect, PointEffect
from sensors.npz import npz_bytes
from sensors.sensor_model import SensorModel
from sensors.shot import Shot

_AZIMUTHS = 360
_SAME_DEG = 0.5  # between a laser of the template and one of the sensor


@dataclass(frozen=True, eq=False)
class LaserTable:
    """Lasers from the top, as drivers describe them.

    Attributes:
        elevation_deg: (k,) true elevations.
        azimuth_deg: (k,) offsets, positive counter-clockwise.
        centre_m: (k,) heights of the optical centres above the origin.
        range_offset_m: (k,) to be added to measured ranges.
        notes: effects that the formats cannot hold, a sentence each.
    """

    elevation_deg: np.ndarray
    azimuth_deg: np.ndarray
    centre_m: np.ndarray
    range_offset_m: np.ndarray
    notes: tuple[str, ...]


def laser_table(sensor: SensorModel) -> LaserTable:
    """Properties of each laser according to a sensor file."""
    pattern = sensor.pattern
    even = pattern.model_copy(update={"firings": _AZIMUTHS, "azimuth_offset_deg": (0.0,) * pattern.rings})
    rays = even.rays()
    beam_effects = [one for one in in_order(sensor.effects) if isinstance(one, BeamEffect) and one.channel != "pose"]
    beams = act_on_beams(
        beam_effects, Beams.nominal(rays), Shot(even, rays), Streams(np.random.default_rng(0)), "export"
    )
    x, y, z = beams.direction.astype(float).T
    shape = (pattern.rings, _AZIMUTHS)
    elevation = np.degrees(np.arctan2(z, np.hypot(x, y))).reshape(shape)
    turned = np.angle(np.exp(1j * (np.arctan2(y, x) - rays.azimuth.astype(float)))).reshape(shape)
    offsets = np.zeros(pattern.rings)
    for one in sensor.effects:
        values = one.model_dump()
        for name in ("offset_m", "offsets_m"):
            if isinstance(one, PointEffect) and name in values:
                offsets -= np.asarray(values[name], float)
    return LaserTable(
        elevation_deg=elevation.mean(1),
        azimuth_deg=np.array(pattern.azimuth_offset_deg, float) + np.degrees(turned.mean(1)),
        centre_m=beams.origin[:, 2].astype(float).reshape(shape).mean(1),
        range_offset_m=offsets,
        notes=_notes(sensor, elevation, turned),
    )


def write_calibration(sensor: SensorModel, folder: Path, template: Path | None = None) -> dict[str, int]:
    """Write all formats; returns how many files and lasers.

    Args:
        sensor: calibrated.
        folder: to write.
        template: Velodyne's or Hesai's file of the same sensor, whose numbers of lasers are kept.

    Raises:
        CosimError: the template is of another sensor, or damaged.
        OutputError: the folder cannot be written.
    """
    table = laser_table(sensor)
    numbers = np.arange(len(table.elevation_deg)) if template is None else laser_numbers(template, table)
    files = {
        "velodyne.yaml": yaml.safe_dump(velodyne_document(table, numbers), sort_keys=False),
        "hesai.csv": hesai_text(table, numbers),
        "ouster.json": json.dumps(ouster_document(sensor, table), indent=2) + "\n",
        "ros.param.yaml": yaml.safe_dump(ros_document(sensor), sort_keys=False),
        "README.txt": _readme(sensor, table, template),
    }
    with explained(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            (folder / name).write_text(text, encoding="utf-8")
        (folder / "ncore.npz").write_bytes(npz_bytes(ncore_arrays(sensor, table)))
    return {"files": len(files) + 1, "lasers": len(numbers)}


def velodyne_document(table: LaserTable, numbers: np.ndarray) -> dict[str, Any]:
    """`calibration.yaml` of the ROS driver; angles in radians, azimuths as the driver takes them off the head's."""
    lasers = [
        {
            "dist_correction": float(table.range_offset_m[row]),
            "dist_correction_x": float(table.range_offset_m[row]),
            "dist_correction_y": float(table.range_offset_m[row]),
            "focal_distance": 0.0,
            "focal_slope": 0.0,
            "horiz_offset_correction": 0.0,
            "laser_id": int(numbers[row]),
            "max_intensity": 255,
            "min_intensity": 0,
            "rot_correction": float(np.radians(table.azimuth_deg[row])),
            "two_pt_correction_available": False,
            "vert_correction": float(np.radians(table.elevation_deg[row])),
            "vert_offset_correction": float(table.centre_m[row]),
        }
        for row in np.argsort(numbers)
    ]
    return {"distance_resolution": 0.002, "lasers": lasers, "num_lasers": len(lasers)}


def hesai_text(table: LaserTable, numbers: np.ndarray) -> str:
    """Hesai's angle correction file; azimuth offsets are positive clockwise there."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("Channel", "Elevation", "Azimuth"))
    for row in np.argsort(numbers):
        elevation, azimuth = table.elevation_deg[row], -table.azimuth_deg[row]
        writer.writerow((int(numbers[row]) + 1, f"{elevation:.4f}", f"{azimuth:.4f}"))
    return text.getvalue()


def ouster_document(sensor: SensorModel, table: LaserTable) -> dict[str, Any]:
    """Angles of Ouster's metadata, in degrees, lasers from the top; azimuths positive clockwise."""
    rate = round(1 / sensor.pattern.sweep_s)
    return {
        "beam_intrinsics": {
            "beam_altitude_angles": table.elevation_deg.round(4).tolist(),
            "beam_azimuth_angles": (-table.azimuth_deg).round(4).tolist(),
            "lidar_origin_to_beam_origin_mm": 0.0,
        },
        "lidar_data_format": {"columns_per_frame": sensor.pattern.firings, "pixels_per_column": sensor.pattern.rings},
        "config_params": {"lidar_mode": f"{sensor.pattern.firings}x{rate}"},
    }


def ros_document(sensor: SensorModel) -> dict[str, Any]:
    """Parameters of ROS 2 drivers, as Autoware's launch files load them."""
    low, high = sensor.pattern.range_m
    return {
        "/**": {
            "ros__parameters": {
                "calibration_file": "velodyne.yaml",
                "angle_correction_file": "hesai.csv",
                "rotation_speed": round(60 / sensor.pattern.sweep_s),
                "scan_phase": 0.0,
                "min_range": float(low),
                "max_range": float(high),
                "num_lasers": sensor.pattern.rings,
            }
        }
    }


def ncore_arrays(sensor: SensorModel, table: LaserTable) -> dict[str, np.ndarray]:
    """Elevations and azimuth offsets of rows and azimuths of columns [rad], as NCore's structured spinning LiDAR."""
    firings = sensor.pattern.firings
    column = np.pi - 2 * np.pi * (np.arange(firings) + 0.5) / firings
    return {
        "row_elevations_rad": np.radians(table.elevation_deg).astype(np.float32),
        "row_azimuth_offsets_rad": np.radians(table.azimuth_deg).astype(np.float32),
        "column_azimuths_rad": column.astype(np.float32),
        "spinning_frequency_hz": np.array([1 / sensor.pattern.sweep_s], np.float32),
    }


def laser_numbers(template: Path, table: LaserTable) -> np.ndarray:
    """(k,) numbers from 0 of the lasers in a driver's own file, matched by elevation with the least total difference.

    Raises:
        CosimError: it is no such file, or of another sensor.
    """
    known = _template_elevations(template)
    apart = np.abs(np.array([elevation for _, elevation in known])[:, None] - table.elevation_deg)
    rows, lasers = linear_sum_assignment(apart)
    if len(lasers) < len(table.elevation_deg) or apart[rows, lasers].max() > _SAME_DEG:
        raise CosimError(
            f"{template}: its {len(known)} lasers do not match the sensor's {len(table.elevation_deg)} within "
            f"{_SAME_DEG}° one to one; give the file of the same sensor"
        )
    return np.array([known[row][0] for row in rows[np.argsort(lasers)]])


def _template_elevations(template: Path) -> list[tuple[int, float]]:
    """Number from 0 and elevation [°] of each laser of a Velodyne or Hesai file."""
    text = read_text(template)
    try:
        if template.suffix.lower() == ".csv":
            rows = [row for row in csv.reader(io.StringIO(text)) if row and row[0].strip().isdecimal()]
            found = [(int(row[0]) - 1, float(row[1])) for row in rows]
        else:
            lasers = yaml.safe_load(text)["lasers"]
            found = [(int(one["laser_id"]), float(np.degrees(one["vert_correction"]))) for one in lasers]
    except (yaml.YAMLError, KeyError, TypeError, ValueError, IndexError) as error:
        raise CosimError(f"{template}: no Velodyne .yaml or Hesai .csv calibration ({error})") from None
    if not found:
        raise CosimError(f"{template}: no laser in it; give a Velodyne .yaml or Hesai .csv calibration")
    return found


def _notes(sensor: SensorModel, elevation: np.ndarray, turned: np.ndarray) -> tuple[str, ...]:
    notes = []
    varying = max(float(np.ptp(elevation, axis=1).max()), float(np.degrees(np.ptp(turned, axis=1).max())))
    if varying > 1e-3:
        notes.append(f"beams vary by {varying:.3f}° with the azimuth of the head; these formats hold the mean")
    for one in sensor.effects:
        held = isinstance(one, BeamEffect) or {"offset_m", "offsets_m"} & set(type(one).model_fields)
        if not held:
            notes.append(f"{one.name} is not part of these formats")
    return tuple(notes)


def _readme(sensor: SensorModel, table: LaserTable, template: Path | None) -> str:
    order = (
        f"as in {template.name}" if template else "from the top, from 0 (Hesai: 1); give --template for the driver's"
    )
    lines = [
        f"Calibration of {sensor.pattern.name}: {sensor.pattern.rings} lasers.",
        f"Numbers of lasers: {order}.",
        "velodyne.yaml: angles [rad]; hesai.csv, ouster.json: angles [deg]; ncore.npz: angles [rad].",
        "Ouster's heads differ in lidar_origin_to_beam_origin_mm, which is 0 here: keep the sensor's own value.",
        *table.notes,
    ]
    return "\n".join(lines) + "\n"
