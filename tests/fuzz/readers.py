"""Every reader of files that may come from strangers, with files that it reads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from assets.external import load_external
from assets.streets import StreetLane, Streets
from cosim.capture.config import load_config
from cosim.driver_discrepancy.tracks import read_tracks
from cosim.drives.check import check_drive
from cosim.drives.kitti import Drive
from cosim.drives.kitti.calibration import read_calibration
from cosim.drives.kitti.images import read_depth, read_image
from cosim.drives.kitti.labels import read_labels
from cosim.drives.kitti.oxts import read_oxts
from cosim.drives.kitti.points import read_points, read_points_lenient
from cosim.drives.kitti.rays import read_rays
from cosim.drives.twin import read_frame, read_glb, read_materials
from cosim.scene.world_file import WorldFile
from cosim.traffic.trajectories import read_trajectories
from sensors.hits_file import load_hits
from sensors.pattern import load_pattern
from sensors.rig import load_rig
from sensors.sensor_model import load_sensor
from sumo_nets import read_town
from tests.fuzz.mutations import Mutation, spoil_bytes, spoil_glb, spoil_json, spoil_text, spoil_zip
from training.evaluation.read import read_results


@dataclass(frozen=True)
class Reader:
    """A file that someone might send, and what reads it.

    Attributes:
        name: of the reader.
        file: the file to spoil, relative to the material.
        spoil: how.
        read: called with the path of that file.
    """

    name: str
    file: str
    spoil: Mutation
    read: Callable[[Path], object]


def _hits(path: Path) -> object:
    return load_hits(path, load_pattern("hdl64e").rays())


def _drive(path: Path) -> object:
    drive = Drive(path.parent)
    return [drive[name].points for name in drive.frames[:1]]


def _results(path: Path) -> object:
    return read_results(path.parent, path.parent.parent / "drive/label_2")


_ROAD = Streets(
    "road", (StreetLane("e_0", "e", "drive", np.array([[-10.0, 0, 0], [110, 0, 0]]), 7.0, 14.0, False),), (), (), ()
)


def _trajectories(path: Path) -> object:
    return read_trajectories(path, _ROAD, [path])


def _scenario(path: Path) -> object:
    return read_trajectories(path, read_town(path).streets)


def _world(path: Path) -> object:
    return WorldFile(file=path).read(_ROAD)


def _above(read: Callable[[Path], object]) -> Callable[[Path], object]:
    """What reads the folder that a file is in."""
    return lambda path: read(path.parent)


READERS = (
    Reader("points", "drive/velodyne/000000.bin", spoil_bytes, read_points),
    Reader("lenient points", "drive/velodyne/000000.bin", spoil_bytes, read_points_lenient),
    Reader("rays", "drive/rays/000000.npz", spoil_zip, read_rays),
    Reader("hits", "drive/hits/000000.npz", spoil_zip, _hits),
    Reader("labels", "drive/label_2/000000.txt", spoil_text, read_labels),
    Reader("calibration", "drive/calib/000000.txt", spoil_text, read_calibration),
    Reader("oxts", "drive/oxts/000000.txt", spoil_text, read_oxts),
    Reader("images", "drive/image_2/000000.png", spoil_bytes, read_image),
    Reader("depth", "drive/depth_0/000000.png", spoil_bytes, read_depth),
    Reader("twin frame", "drive/twin/frames/000000.json", spoil_json, read_frame),
    Reader("twin world", "car.glb", spoil_glb, read_glb),
    Reader("twin materials", "drive/twin/materials.yaml", spoil_text, read_materials),
    Reader("manifest", "drive/manifest.jsonl", spoil_text, _drive),
    Reader("summary", "drive/drive.yaml", spoil_text, _drive),
    Reader("checksums", "drive/drive.yaml", spoil_text, _above(check_drive)),
    Reader("checksums of frames", "drive/manifest.jsonl", spoil_text, _above(check_drive)),
    Reader("pattern", "pattern.yaml", spoil_text, load_pattern),
    Reader("sensor", "sensor.yaml", spoil_text, load_sensor),
    Reader("configuration", "run.yaml", spoil_text, load_config),
    Reader("town", "town/town.sumocfg", spoil_text, _above(read_town)),
    Reader("net", "town/town.net.xml", spoil_text, _above(read_town)),
    Reader("parking", "town/town.add.xml", spoil_text, _above(read_town)),
    Reader("vehicles", "vehicles/vehicles.yaml", spoil_text, _above(load_external)),
    Reader("vehicle glb", "vehicles/car.glb", spoil_glb, _above(load_external)),
    Reader("vehicle obj", "vehicles/box.obj", spoil_text, _above(load_external)),
    Reader("vehicle dae", "vehicles/box.dae", spoil_text, _above(load_external)),
    Reader("trajectories", "tracks.csv", spoil_text, read_tracks),
    Reader("replayed table", "tracks.csv", spoil_text, lambda path: read_trajectories(path, _ROAD)),
    Reader("tracks of a data set", "motion.csv", spoil_text, lambda path: read_trajectories(path, _ROAD)),
    Reader("FCD output", "fcd.xml", spoil_text, _trajectories),
    Reader("CommonRoad", "lanes.xml", spoil_text, _scenario),
    Reader("OpenSCENARIO", "play.xosc", spoil_text, lambda path: read_trajectories(path, _ROAD)),
    Reader("OpenSCENARIO lanes", "drive.xosc", spoil_text, lambda path: read_trajectories(path, _ROAD)),
    Reader("OpenDRIVE", "street.xodr", spoil_text, lambda path: read_trajectories(path.with_name("drive.xosc"), _ROAD)),
    Reader("rig", "rig.yaml", spoil_text, load_rig),
    Reader("world", "road.glb", spoil_glb, _world),
    Reader("detections", "detections/000000.txt", spoil_text, _results),
)
