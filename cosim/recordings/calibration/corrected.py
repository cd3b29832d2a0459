"""Scans of a calibrated recording as a right sensor would have measured them, and their poses."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from cosim.drives.files import read_bytes, read_text
from cosim.drives.writer import explained
from cosim.errors import CosimError
from cosim.recordings.mapping.correction import Correction
from cosim.recordings.mapping.motion import deskewed, motions, scan_times
from cosim.recordings.pattern.find import find_pattern
from cosim.recordings.recording import open_recording
from sensors.effects.registry import effect_classes
from sensors.npz import npz_arrays
from sensors.sensor_model import load_sensor

RESULT = "result.json"


def calibration_result(folder: Path) -> dict[str, Any]:
    """Read the result of `cosim calibrate` from its folder.

    Raises:
        CosimError: the folder holds no finished calibration.
    """
    file = folder / RESULT
    if not file.is_file():
        raise CosimError(f"{folder}: no {RESULT}; give the --out folder of a finished `cosim calibrate`")
    try:
        return json.loads(read_text(file))
    except ValueError as error:
        raise CosimError(f"{file}: {error}; run `cosim calibrate` again") from None


def write_corrected(
    folder: Path, out: Path, on_scan: Callable[[], object] = lambda: None, **options: object
) -> dict[str, int]:
    """Write scans freed of the motion in a sweep and of what the calibration found, and poses; returns counts.

    Args:
        folder: of the calibration.
        out: to write: `velodyne/*.bin` (float32 x y z intensity), `poses.txt` (KITTI) and `poses.tum`.
        on_scan: called after each scan.
        options: of the recording, see `open_recording`.

    Raises:
        CosimError: no calibration, or its recording has moved or changed.
        OutputError: the folder cannot be written.
    """
    result = calibration_result(folder)
    recording = open_recording(result["recording"], **options)
    sensor = load_sensor(folder / result["sensor_file"])
    poses = npz_arrays(read_bytes(folder / result["poses_file"]))["pose"]
    if len(poses) != len(recording):
        raise CosimError(f"{recording.path}: {len(recording)} scans, calibrated were {len(poses)}; calibrate it again")
    found = find_pattern(recording)
    apart = np.abs(found.lasers.elevation_deg[:, None] - np.array(sensor.pattern.elevation_deg))
    known = tuple(one for one in sensor.effects if one.name in effect_classes())
    correction = Correction(sensor.pattern, found.lasers.lines, apart.argmin(1), known)
    scale = correction.sweep_scale()
    motion = motions(poses, recording.turns(sensor.pattern.sweep_s)) * (
        result["sweep_scale"] if scale is None else scale
    )
    with explained(out):
        (out / "velodyne").mkdir(parents=True, exist_ok=True)
        for number, scan in enumerate(recording):
            right = correction.undone(scan) if correction.is_needed else scan
            share = scan_times(scan.azimuth_rad, scan.time_s, sensor.pattern.sweep_s) / sensor.pattern.sweep_s
            xyz = deskewed(right.xyz, share, motion[number])
            light = np.zeros(len(xyz)) if right.intensity is None else right.intensity
            np.column_stack([xyz, light]).astype("<f4").tofile(out / "velodyne" / f"{number:06d}.bin")
            on_scan()
        np.savetxt(out / "poses.txt", poses[:, :3].reshape(-1, 12), fmt="%.9g")
        stamps = recording.turns(sensor.pattern.sweep_s) * sensor.pattern.sweep_s
        stamps = stamps if recording.stamp_s is None else recording.stamp_s
        quaternion = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
        rows = np.column_stack([stamps, poses[:, :3, 3], quaternion])
        np.savetxt(out / "poses.tum", rows, fmt=["%.6f", *["%.9g"] * 7])
    return {"scans": len(recording), "poses": len(poses)}
