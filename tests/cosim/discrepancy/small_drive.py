"""A measured drive of a yard with walls, crates and a moving car, small enough to be made and compared in no time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from assets.mesh import Mesh
from assets.shapes import box, plate
from cosim.discrepancy.analysis import FittedFrames, context_of, trace_and_fit
from cosim.discrepancy.data.checks import opened
from cosim.drives.kitti import PointRays, write_points, write_rays
from cosim.drives.twin import Ego, Instance, Lidar, TwinFrame, read_glb, write_frame, write_glb, write_materials
from cosim.drives.twin.scene import ego_motion, lidar_pose, scene_instances
from sensors.effects.acting import in_order
from sensors.effects.base import Effect
from sensors.pattern import Pattern
from sensors.scene import Scene
from sensors.sensor_model import SensorModel

PATTERN = Pattern(
    name="yard", sweep_s=0.1, firings=480, range_m=(0.9, 120.0), elevation_deg=tuple(np.linspace(2, -22, 24).tolist())
)
Change = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Yard:
    """Where a drive and its bare sensor file lie."""

    drive: Path
    sensor: Path


def make_yard(
    folder: Path,
    effects: tuple[Effect, ...] = (),
    *,
    known: tuple[dict, ...] = (),
    frames: int = 3,
    change: Change = lambda points: points,
    shifted_m: float = 0.0,
    columns: int = 4,
    seed: int = 0,
    car: Mesh | None = None,
) -> Yard:
    """Write a drive measured with effects, and the sensor file of a user who knows some of them.

    Args:
        folder: gets `drive/`, `pattern.yaml` and `sensor.yaml`.
        effects: the true ones.
        known: entries of the sensor file.
        frames: how many.
        change: of every scan's points (n, 4) before they are written.
        shifted_m: displacement of the twin from the truth.
        columns: floats a point; 3 leaves intensities out.
        seed: of the sensor's noise.
        car: what the moving car looks like, 4.0 × 1.8 × 1.5 m of `car_paint`; by default a box.
    """
    drive = folder / "drive"
    for part in ("velodyne", "rays", "calib", "twin/frames", "twin/models"):
        (drive / part).mkdir(parents=True)
    write_glb(drive / "twin/static.glb", _world())
    write_glb(drive / "twin/models/crate.glb", car or box((4.0, 1.8, 1.5), (0, 0, 0.75), "car_paint"))
    write_materials(
        drive / "twin/materials.yaml", ("asphalt", "grass", "concrete", "brick", "wood", "car_paint", "car_glass")
    )
    scene = Scene(read_glb(drive / "twin/static.glb"), lambda name: read_glb(drive / f"twin/models/{name}.glb"))
    sensor = SensorModel(PATTERN, effects, "true")
    for number in range(frames):
        name, twin = f"{number:06d}", TwinFrame.from_json(_frame(number).to_json())
        cloud = sensor.trace_and_measure(
            scene,
            lidar_pose(twin),
            scene_instances(twin.instances),
            ego_motion(twin),
            np.random.default_rng([seed, 41, number]),
            frame_time_s=twin.time_s,
        )
        points = change(np.column_stack([cloud.xyz, cloud.intensity]).astype(np.float32))
        if columns == 4:
            write_points(drive / f"velodyne/{name}.bin", points) if np.isfinite(points).all() else points.tofile(
                drive / f"velodyne/{name}.bin"
            )
        else:
            np.ascontiguousarray(points[:, :3]).tofile(drive / f"velodyne/{name}.bin")
        write_rays(
            drive / f"rays/{name}.npz",
            PointRays(cloud.ring, cloud.azimuth, cloud.time_s, cloud.return_no.astype(np.uint8)),
        )
        write_frame(drive / f"twin/frames/{name}.json", _frame(number, shifted_m))
        (drive / f"calib/{name}.txt").write_text(_CALIBRATION)
    report = {"kind": "measured", "pattern": "yard", "sweep_s": 0.1, **({"columns": 3} if columns == 3 else {})}
    (drive / "drive.yaml").write_text(yaml.safe_dump(report))
    for path in (drive, folder):
        (path / "pattern.yaml").write_text(PATTERN.to_yaml())
    document = {"pattern": "./pattern.yaml", "effects": list(known)}
    (folder / "sensor.yaml").write_text(yaml.safe_dump(document, sort_keys=False))
    return Yard(drive, folder / "sensor.yaml")


def fit_yard(yard: Yard, effects: Sequence[Effect] | None = None, free: Sequence[int] = ()) -> FittedFrames:
    """Fit all frames of a yard with effects, by default its sensor's own; those at the indices `free` are fitted."""
    context = context_of(opened(yard.drive), yard.sensor)
    effects = context.initial_effects if effects is None else in_order(effects)
    return trace_and_fit(context, (*context.split.fit, *context.split.test), effects, free)


def _world() -> Mesh:
    tiles = [
        plate(np.array([[x, y], [x + 10, y], [x + 10, y + 10], [x, y + 10]], float), name)
        for x in range(-60, 60, 10)
        for y, name in [(y, "asphalt" if y in (-10, 0) else "grass") for y in range(-60, 60, 10)]
    ]
    walls = [
        box((60, 0.4, 8), (0, 22, 4), "concrete"),
        box((60, 0.4, 8), (0, -22, 4), "brick"),
        box((0.4, 40, 8), (38, 0, 4), "concrete"),
        box((3, 3, 2), (12, 9, 1), "wood"),
        box((2, 4, 3), (-9, -12, 1.5), "concrete"),
    ]
    return Mesh.merge([*tiles, *walls])


def _frame(number: int, shifted_m: float = 0.0) -> TwinFrame:
    ego, lidar, car = np.eye(4), np.eye(4), np.eye(4)
    ego[:3, 3] = [2.0 * number - 6 + shifted_m, 0.6, shifted_m / 4]
    lidar[2, 3] = 1.73
    car[:2, 3] = [14 + 1.5 * number, -3.5]
    crate = Instance("car", "car", "crate", car, np.array([15.0, 0, 0]), 0.0, 4.0, 1.8, 1.5, np.ones(3), 0.3)
    return TwinFrame(
        frame=f"{number:06d}",
        time_s=float(number),
        sweep_s=0.1,
        ego=Ego(ego, np.array([20.0, 0, 0]), 0.0, np.zeros(3)),
        lidar=Lidar(lidar, "yard"),
        cameras={},
        instances=(crate,),
    )


_CALIBRATION = "".join(
    f"{name}: {values}\n"
    for name, values in (
        *((f"P{k}", "700 0 600 0 0 700 180 0 0 0 1 0") for k in range(4)),
        ("R0_rect", "1 0 0 0 1 0 0 0 1"),
        ("Tr_velo_to_cam", "0 -1 0 0 0 0 -1 0 1 0 0 0"),
        ("Tr_imu_to_velo", "1 0 0 0 0 1 0 0 0 0 1 0"),
    )
)
