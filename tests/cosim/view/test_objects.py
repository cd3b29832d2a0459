"""Which object a point belongs to."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.drives.kitti import Drive, PointRays, encode_points, encode_rays
from cosim.drives.twin import Ego, Instance, Lidar, TwinFrame
from cosim.errors import FormatError
from cosim.view.colours import Scale, colour_by_instance, instance_colours
from cosim.view.objects import STATIC, find_instances, find_objects
from sensors.hits import NOTHING, Hits, Surface
from sensors.hits_file import encode_hits
from sensors.pattern import Pattern
from sensors.point_cloud import bare_returns


def test_points_in_a_labelled_box_are_that_objects_and_the_road_is_not(labelled_drive: Path) -> None:
    drive = Drive(labelled_drive)
    frame = drive["000001"]
    objects = find_objects(frame)
    instances = find_instances(drive, frame, objects)
    assert (objects.source, instances.source) == ("labels", "boxes")
    assert (instances.number[-96:] == 0).all()
    assert (instances.number[:-96] == STATIC).all()


def test_without_labels_or_twin_all_is_static(bare_drive: Path) -> None:
    drive = Drive(bare_drive)
    frame = drive["000000"]
    objects = find_objects(frame)
    assert objects.source == "none"
    assert (find_instances(drive, frame, objects).number == STATIC).all()


def test_objects_have_hues_of_their_own_and_the_static_world_is_gray() -> None:
    colours = colour_by_instance(np.array([-1, 0, 1]), np.ones(3))
    assert np.ptp(colours[0]) == 0
    assert np.ptp(colours[1:].astype(int), axis=1).min() > 50
    assert len(np.unique(instance_colours(np.arange(60)), axis=0)) > 50


def test_a_scale_clips_and_a_logarithmic_one_gives_equal_ratios_equal_steps() -> None:
    linear = Scale("intensity", 0, 0.5, "viridis")
    np.testing.assert_array_equal(linear.colours(np.array([0.5, 7.0]))[0], linear.colours(np.array([0.5, 7.0]))[1])
    logarithmic = Scale("range [m]", 3, 48, logarithmic=True)
    np.testing.assert_allclose(logarithmic.share(np.array([3.0, 12.0, 48.0])), [0, 0.5, 1], atol=1e-6)


@pytest.fixture
def traced_drive(bare_drive: Path) -> Path:
    """A simulated frame: two rings of 16 beams, three of them on a pedestrian, some lost, one spurious."""
    pattern = Pattern(name="tiny", sweep_s=0.1, firings=16, range_m=(0.9, 120), elevation_deg=(0.0, -5.0))
    instance = np.full(32, STATIC, np.int16)
    instance[[4, 5, 20]] = 0
    instance[[7, 30]] = NOTHING
    ranges = np.where(instance == NOTHING, np.inf, 10).astype(np.float32)
    solid = Surface(ranges, np.zeros((32, 2), np.int16), np.zeros(32, np.uint8), instance)
    paint = np.array([0.5], np.float32)
    hits = Hits(pattern.rays(), np.eye(4), solid, np.zeros(0, np.int32), solid.take(np.zeros(0, int)), paint)
    cloud = bare_returns(hits)
    kept = np.arange(len(cloud)) != 2
    points = cloud.kitti
    points[5, :3] *= 0.3
    rays = PointRays(cloud.ring, cloud.azimuth, cloud.time_s, cloud.return_no)[kept]
    person = Instance("p", "pedestrian", "m", np.eye(4), np.zeros(3), 0.0, 0.6, 0.6, 1.8, np.ones(3), 0.5)
    ego = Ego(np.eye(4), np.zeros(3), 0.0, np.zeros(3))
    twin = TwinFrame("000000", 0.0, 0.1, ego, Lidar(np.eye(4), "tiny"), {}, (person,))
    files = {
        "pattern.yaml": pattern.to_yaml().encode(),
        "velodyne/000000.bin": encode_points(points[kept]),
        "rays/000000.npz": encode_rays(rays),
        "hits/000000.npz": encode_hits(hits),
        "twin/frames/000000.json": twin.to_json().encode(),
    }
    for name, data in files.items():
        (bare_drive / name).parent.mkdir(parents=True, exist_ok=True)
        (bare_drive / name).write_bytes(data)
    return bare_drive


def test_points_take_the_instance_their_beam_met_whatever_was_lost_before_them(traced_drive: Path) -> None:
    drive = Drive(traced_drive)
    frame = drive["000000"]
    objects = find_objects(frame)
    found = find_instances(drive, frame, objects)
    assert (objects.source, objects.kinds, found.source) == ("twin", ("pedestrian",), "hits")
    azimuth = np.round(16 * (np.pi - frame.rays.azimuth) / (2 * np.pi) - 0.5)
    beams = frame.rays.ring[found.number == 0] * 16 + azimuth[found.number == 0]
    # beam 5 met the pedestrian too, but its point lies 7 m before it
    np.testing.assert_array_equal(beams, [4, 20])


def test_hits_of_another_run_are_refused(traced_drive: Path) -> None:
    file = traced_drive / "twin/frames/000000.json"
    twin = TwinFrame.from_json(file.read_text(encoding="utf-8"))
    file.write_text(replace(twin, instances=()).to_json(), encoding="utf-8")
    drive = Drive(traced_drive)
    with pytest.raises(FormatError, match="different runs"):
        find_instances(drive, drive["000000"], find_objects(drive["000000"]))
