"""A recording's scans become a drive whose twin traces back to them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cosim.discrepancy.analysis import context_of, trace_and_fit
from cosim.discrepancy.data.checks import opened
from cosim.discrepancy.diagnose import fit_nuisances
from cosim.discrepancy.inference.intervals import half_widths
from cosim.discrepancy.inference.parameters import all_free
from cosim.discrepancy.settings import DEFAULT
from cosim.drives.kitti import Drive
from cosim.drives.twin.scene import TwinScenes, lidar_pose, scene_instances
from cosim.drives.writer import OutputError
from cosim.recordings import RecordingError, open_recording
from cosim.recordings.mapping import write_recording_twin
from cosim.recordings.mapping.build import holding
from cosim.recordings.mapping.motion import deskewed, motions, scan_times
from cosim.recordings.mapping.moving import FreeSpace, looked_at
from cosim.recordings.mapping.odometry import find_trajectory
from cosim.recordings.mapping.surfels import Cloud, SurfelSettings, make_surfels, quads
from cosim.recordings.mapping.sweep import SweepEstimate, sweep_motion
from sensors.effects.beams.elevation_offset import ElevationOffset
from sensors.effects.beams.sweep_motion import SweepMotion
from sensors.effects.lasers import with_rings
from sensors.effects.light.ring_gain import RingGain
from sensors.effects.points.intensity_noise import IntensityNoise
from sensors.effects.points.range_noise import RangeNoise
from sensors.pattern import load_pattern
from sensors.sensor_model import SensorModel
from sensors.tracing import Tracer
from tests.cosim.conftest import refused
from tests.cosim.recordings.simulated import HEIGHT_M, SCANS, STEP_M, TURN_RAD, carried, path, record


def test_the_path_and_the_height_of_the_sensor_are_detected(twin: Path) -> None:
    result = json.loads((twin / "twin.json").read_text())
    assert result["path_m"] == pytest.approx(STEP_M * (SCANS - 1), rel=0.03)
    assert result["mount"]["height_m"] == pytest.approx(HEIGHT_M, abs=0.03) and result["mount"]["from_ground"]
    assert result["lasers"] == 32
    assert 0.001 < result["thickness_ground_m"] < 0.03
    assert result["error_held_out_m"] < 0.04


def test_whether_points_were_freed_of_the_motion_in_a_sweep_is_fitted_along(twin: Path, tmp_path: Path) -> None:
    assert json.loads((twin / "twin.json").read_text())["sweep_strength"] == pytest.approx(1, abs=0.25)
    pattern, motion = load_pattern("vlp32c"), motions(path())[0]
    for file in sorted((twin / "scans").iterdir())[:10]:
        points = np.fromfile(file, "<f4").reshape(-1, 4)
        share = scan_times(np.arctan2(points[:, 1], points[:, 0]).astype(float), None, 1.0)
        points[:, :3] = deskewed(points[:, :3].astype(float), share, motion)
        points.tofile(tmp_path / file.name)
    recording = open_recording(tmp_path)
    trajectory = find_trajectory(recording, pattern.sweep_s)
    lines = np.column_stack([np.radians(pattern.elevation_deg), np.zeros(pattern.rings)])
    found = sweep_motion(recording, trajectory, lines, pattern.sweep_s, SurfelSettings())
    assert found.is_compensated == "yes" and found.scale == 0
    assert found.low < 0 < found.high < 1 or found.cones[2] > found.cones[0] + 0.1


def test_no_motion_is_removed_from_points_that_contain_none() -> None:
    """Those of a simulated sensor that measures all directions at once lie on the cones of its lasers as well."""
    on_cones = (1.0, 0.4, 0.4)
    at_once = SweepEstimate(0.01, -0.03, 0.05, np.zeros(2), on_cones, {})
    assert at_once.is_compensated == "no" and at_once.scale == 0 and "none is removed" in at_once.evidence
    undetermined = SweepEstimate(0.3, -0.5, 1.1, np.zeros(2), on_cones, {})
    assert undetermined.is_compensated == "no" and undetermined.scale == 1


def test_poses_of_the_twin_are_those_of_the_drive(twin: Path) -> None:
    drive = Drive(twin / "twin")
    found = np.array([lidar_pose(frame.twin) for frame in drive])
    found = np.linalg.inv(found[0]) @ found
    np.testing.assert_allclose(found[:, :3, 3], path()[:, :3, 3], atol=0.08)


def test_the_twin_traces_back_to_the_scans(twin: Path) -> None:
    drive = Drive(twin / "twin")
    frame = drive["000004"]
    pattern = load_pattern(str(drive.pattern))
    scene = TwinScenes(drive).of(frame)
    hits = Tracer(carried(pattern), pattern.range_m).trace(scene, lidar_pose(frame.twin), scene_instances(()))
    reach = hits.solid.range_m.reshape(pattern.rings, pattern.firings).astype(float)
    turned = frame.rays.azimuth - np.radians(np.array(pattern.azimuth_offset_deg))[frame.rays.ring]
    column = np.round((np.pi - turned) / (2 * np.pi) * pattern.firings - 0.5).astype(int) % pattern.firings
    measured = np.linalg.norm(frame.points[:, :3], axis=1)
    off = reach[frame.rays.ring, column] - measured
    met = np.isfinite(off) & (measured < 20) & (measured > 2.5)
    assert np.median(np.abs(off[met])) < 0.06
    assert np.mean(np.abs(off[met]) < 0.3) > 0.6


def test_points_are_stored_ring_by_ring_with_their_beams(twin: Path) -> None:
    frame = Drive(twin / "twin")["000000"]
    assert not frame.rays.recovered and (np.diff(frame.rays.ring.astype(int)) >= 0).all()
    elevation = np.degrees(np.arctan2(frame.points[:, 2], np.hypot(frame.points[:, 0], frame.points[:, 1])))
    named = np.array(load_pattern("vlp32c").elevation_deg)[frame.rays.ring]
    assert np.abs(elevation - named).max() < 0.07
    assert np.abs(frame.rays.time_s).max() <= 0.0501


def test_the_page_and_the_lists_of_scans_are_there(twin: Path) -> None:
    page = (twin / "page/index.html").read_text()
    for words in ("From above", "Thickness by place", "Thickness by number of scans", "Left out", "Error by scan"):
        assert words in page
    drive = Drive(twin / "twin")
    assert set(drive.split("held_out")) | set(drive.split("fit")) == set(drive.frames)
    assert "scans only" in " ".join(json.loads((twin / "twin.json").read_text())["notes"])


def test_a_sweep_is_undone_by_the_motion_that_made_it() -> None:
    rng = np.random.default_rng(0)
    world, share = rng.uniform(-20, 20, (500, 3)), rng.uniform(-0.5, 0.5, 500)
    motion = np.array([0.0, 0.0, 0.02, 1.0, 0.1, 0.0])
    turn = Rotation.from_rotvec(share[:, None] * motion[:3])
    measured = turn.inv().apply(world - share[:, None] * motion[3:])
    np.testing.assert_allclose(deskewed(measured, share, motion), world, atol=1e-9)


def test_motion_of_a_steady_drive_is_its_step() -> None:
    for motion in motions(path()):
        np.testing.assert_allclose(motion, [0, 0, TURN_RAD, STEP_M, 0, 0], atol=0.006)


def test_surfels_lie_on_the_plane_and_know_its_scatter() -> None:
    rng = np.random.default_rng(0)
    xyz = rng.uniform(-3, 3, (40000, 3))
    xyz[:, 2] = 0.1 * xyz[:, 0] + 0.17 + rng.normal(0, 0.01, len(xyz))
    ray, ones = np.tile([0, 0, -1.0], (len(xyz), 1)), np.ones(len(xyz))
    elevation_deg = np.where(xyz[:, 0] < 0, -8.0, rng.choice([-8.0, -10.0], len(xyz)))  # of one laser, of two
    cloud = Cloud(xyz.astype(np.float32), rng.integers(0, 9, len(xyz)), ones, ray, elevation_deg, ones)
    surfels, _ = make_surfels(cloud, SurfelSettings())
    several = surfels.of_several_lasers(SurfelSettings())
    assert several[surfels.low[:, 0] > 0.1].all() and not several[surfels.high[:, 0] < 0].any()
    assert len(surfels) > 100 and np.median(surfels.sd_m) == pytest.approx(0.01, rel=0.1)
    normal = np.array([-0.1, 0, 1]) / np.hypot(1, 0.1)
    assert np.median(surfels.normal @ normal) > 0.9995
    vertices, faces = quads(surfels)
    assert faces.shape == (2 * len(surfels), 3)
    assert np.median(np.abs(vertices[:, 2] - 0.1 * vertices[:, 0] - 0.17)) < 0.01


def test_a_tunnel_holds_no_scan_along_it_however_sharp_its_map() -> None:
    rng, rays = np.random.default_rng(0), load_pattern("vlp16").rays().direction.astype(float)
    walls = {"tunnel": np.array([np.inf, 4.0, 1.8]), "hall": np.array([9.0, 4.0, 1.8])}
    held = {}
    for name, half in walls.items():
        away = (half / np.maximum(np.abs(rays), 1e-9)).min(1)  # to the walls of a box about the sensor
        rows = np.flatnonzero(away < 60)
        held[name] = holding(rays[rows] * (away[rows] + rng.normal(0, 0.02, len(rows)))[:, None])
    assert held["tunnel"] < 0.001 and held["hall"] > 0.02


def test_notes_report_that_stationary_scans_are_not_sufficient(tmp_path: Path) -> None:
    pytest.importorskip("kiss_icp")
    still = np.repeat(np.eye(4)[None], 6, 0)
    recording = open_recording(record(tmp_path / "scans", still, load_pattern("vlp16")))
    assert find_trajectory(recording, 0.1).standing
    made = write_recording_twin(recording, tmp_path / "twin")
    assert any("seen from one position" in note for note in made.notes)
    assert made.made.trusted[made.made.ground].mean() < 0.1  # cells with points of a single laser


def test_bad_input_is_refused(tmp_path: Path) -> None:
    folder = record(tmp_path / "scans", path(4), load_pattern("vlp16"))
    assert "4 scans; a map needs five" in refused("twin", folder, "--out", tmp_path / "out")
    recording = open_recording(record(tmp_path / "more", path(5), load_pattern("vlp16")))
    with pytest.raises(RecordingError, match="omit --pattern"):
        write_recording_twin(recording, tmp_path / "out", pattern="hdl64e")
    with pytest.raises(OutputError, match="the recording itself"):
        write_recording_twin(recording, tmp_path / "more")
    assert "no PointCloud2" in refused_bag(tmp_path)


def refused_bag(folder: Path) -> str:
    from tests.cosim.recordings.test_readers import write_bag

    (folder / "bags").mkdir()
    return refused("twin", write_bag(folder / "bags", "sqlite3", {}), "--out", folder / "out")


def test_a_fit_finds_the_motion_in_the_sweep_together_with_noise(twin: Path) -> None:
    drive = Drive(twin / "twin")
    sensor = SensorModel(load_pattern(str(drive.pattern)), (RangeNoise(sigma_m=0.02), IntensityNoise(sigma_rel=0.1)))
    context = context_of(
        opened(drive), sensor, settings=replace(DEFAULT, rows=8_000), refitted=("range_noise", "intensity_noise")
    )
    on = fit_nuisances(context)
    fitter, fitted = on.fitter, on.fitted
    again = fitter.fit(fitted.effects, (), fitted.estimate)
    assert again.loglik - fitted.loglik < 5, "surfaces have their most likely brightness after one fit"
    effects = (*fitted.effects, SweepMotion(sweep_s=0.0))
    free = all_free(effects, range(len(effects)), fitter.rings)
    moving = fitter.fit(effects, free, fitted.estimate)
    assert moving.loglik - fitted.loglik > 50
    assert moving.effects[-1].model_dump()["sweep_s"] == pytest.approx(0.1, rel=0.3)


def test_gains_of_lasers_are_relative_to_their_mean_where_reflectances_are_unknown(twin: Path) -> None:
    drive = Drive(twin / "twin")
    pattern = load_pattern(str(drive.pattern))
    known = (RangeNoise(sigma_m=0.02), IntensityNoise(sigma_rel=0.01))
    context = context_of(opened(drive), SensorModel(pattern, known), settings=replace(DEFAULT, rows=8_000))
    on = fit_nuisances(context)
    start = tuple(1 + 0.3 * (ring % 2) for ring in range(pattern.rings))
    effects = with_rings((RingGain(gains=start), *on.fitted.effects), pattern.rings)
    fitted = on.fitter.fit(effects, all_free(effects, (0,), on.fitter.rings), on.fitted.estimate)
    gains = np.array(fitted.effects[0].model_dump()["gains"])
    assert np.median(np.abs(gains / np.median(gains) - 1)) < 0.02
    widths = half_widths(on.fitter, fitted)
    assert np.median(widths) < 0.05, "the common factor is not part of the intervals"


def test_beams_keep_the_surfaces_of_their_points_in_a_map_of_the_scans(twin: Path) -> None:
    drive = Drive(twin / "twin")
    sensor = SensorModel(load_pattern(str(drive.pattern)), (RangeNoise(sigma_m=0.02),))
    context = context_of(opened(drive), sensor, settings=replace(DEFAULT, rows=4_000))
    names, tilted = context.split.fit[:3], (ElevationOffset(offset_deg=0.3), *sensor.effects)
    on = trace_and_fit(context, names, tilted)
    for frame, name in zip(on.frames, names, strict=True):
        np.testing.assert_array_equal(frame.surface, context.tracer.trace(name, ()).surface)


def test_what_stood_before_the_sky_and_is_gone_moves_and_what_is_too_far_to_return_does_not() -> None:
    rng, away = np.random.default_rng(0), 10.2
    board = np.column_stack([rng.normal(away, 0.01, 400), rng.uniform(-0.2, 0.2, 400), rng.uniform(0.0, 0.4, 400)])
    pole = np.column_stack([rng.normal(away, 0.01, 400), rng.uniform(2.0, 2.4, 400), rng.uniform(0.0, 0.4, 400)])
    xyz = np.concatenate([board, pole]).astype(np.float32)
    reach = np.linalg.norm(xyz, axis=1)
    scan = np.tile(np.arange(4, dtype=np.int32), 200)
    plain = np.zeros(800, np.float32)
    surfels, _ = make_surfels(Cloud(xyz, scan, reach, xyz / reach[:, None], plain, plain), SurfelSettings())
    is_board = np.abs(surfels.centre[:, 1]) < 1
    both, one = xyz, pole.astype(np.float32)
    space = FreeSpace(surfels, looked_at([both]))
    for seen in (both, one, one, one, one):
        space.add(seen, np.eye(4))
    np.testing.assert_array_equal(space.moving(), is_board)
    farther = np.eye(4)
    farther[0, 3] = -away
    space = FreeSpace(surfels, looked_at([both]))
    for _ in range(4):
        space.add(np.zeros((0, 3), np.float32), farther)
    assert not space.moving().any()
