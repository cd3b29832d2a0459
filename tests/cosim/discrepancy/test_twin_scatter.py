"""Labels and maps that are off show in what ranges share, and then ranges on what is off are unsure."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy import diagnose
from cosim.discrepancy.data.checks import opened
from cosim.discrepancy.data.frames import FrameTracer, Scatter
from cosim.discrepancy.twin_scatter import map_scatter_m, with_scatter
from cosim.drives.twin import read_glb, write_glb
from sensors.effects.registry import find_effect
from sensors.hits import STATIC
from sensors.sensor_model import load_sensor
from tests.cosim.discrepancy.conftest import NOISE
from tests.cosim.discrepancy.small_drive import Yard, make_yard, settled

FRAMES = 16


@pytest.fixture
def yard(tmp_path: Path) -> Yard:
    noise = find_effect("range_noise").model_validate({"sigma_m": 0.01})
    return make_yard(tmp_path, (noise,), known=(NOISE,), frames=FRAMES)


def test_exact_labels_are_taken_for_exact(yard: Yard) -> None:
    for frame in settled(yard).frames:
        assert frame.scatter.labels_m == 0
        assert not frame.unsure_m.any()


def test_labels_off_by_a_decimetre_make_objects_unsure_and_nothing_else(yard: Yard) -> None:
    rng = np.random.default_rng(5)
    for path in sorted((yard.drive / "twin/frames").glob("*.json")):
        told = json.loads(path.read_text())
        for row in (0, 1):
            told["instances"][0]["pose"][row][3] += 0.1 * rng.standard_normal()
        path.write_text(json.dumps(told))
    for frame in settled(yard).frames:
        assert 0.04 < frame.scatter.labels_m < 0.2
        of_object = frame.shot.hits.solid.instance >= 0
        assert (frame.unsure_m[of_object] >= frame.scatter.labels_m * 0.99).all()
        assert not frame.unsure_m[~of_object].any()
        assert frame.exact is not None
        assert (frame.edge >= frame.exact.edge).all()
        assert frame.edge.mean() < 1.5 * frame.exact.edge.mean()


def _warp(yard: Yard, size_m: float) -> None:
    """Lift the twin's static world up and down in waves of some tens of metres."""
    path = yard.drive / "twin/static.glb"
    mesh = read_glb(path)
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    lifted = size_m * (np.sin(x / 4.1 + 1) + np.sin(y / 3.3) + np.sin((x + y) / 5.7 + 2)) / np.sqrt(1.5)
    write_glb(path, replace(mesh, vertices=mesh.vertices + lifted[:, None] * [0, 0, 1]))


def test_an_exact_map_is_taken_for_exact(yard: Yard) -> None:
    found = settled(yard)
    assert map_scatter_m(found.frames, found.fitter, found.fitted) == 0


def test_a_map_off_by_centimetres_shows_how_far_and_makes_flat_views_of_it_unsure(yard: Yard) -> None:
    _warp(yard, 0.05)
    found = settled(yard)
    off_m = map_scatter_m(found.frames, found.fitter, found.fitted)
    assert 0.008 < off_m < 0.06
    for frame in with_scatter(found.frames, Scatter(map_m=off_m)):
        solid = frame.shot.hits.solid
        ground = (solid.instance == STATIC) & (solid.normal[:, 2] > 0.9)
        assert np.corrcoef(frame.unsure_m[ground], solid.range_m[ground])[0, 1] > 0.9
        assert not frame.unsure_m[solid.instance >= 0].any()


def test_what_stands_a_touch_aside_of_a_beam_is_no_stray_where_the_map_is_off(tmp_path: Path) -> None:
    noise = find_effect("range_noise").model_validate({"sigma_m": 0.01})
    alarms = find_effect("false_alarms").model_validate({"rate_per_frame": 30.0})
    yard = make_yard(tmp_path, (noise, alarms), known=(NOISE,), frames=2)
    _warp(yard, 0.05)
    for frame in settled(yard).frames:
        (unsure,) = with_scatter([frame], Scatter(map_m=0.05))
        away_m = np.abs(frame.observed.along_m - frame.shot.hits.solid.range_m)
        stray = np.isfinite(frame.observed.along_m) & ~(away_m < 2.0) & ~frame.edge
        kept = stray & ~unsure.edge
        assert 15 < kept.sum() < 45  # the alarms
        assert (unsure.edge >= frame.edge).all()
        assert not (unsure.edge & ~frame.edge & (away_m < 0.4)).any()


def test_a_map_that_is_off_is_no_missing_effect(yard: Yard) -> None:
    _warp(yard, 0.05)
    said: list[str] = []
    found = diagnose(yard.drive, yard.sensor, on_progress=said.append)
    assert any("the map is off" in line for line in said)
    assert found.verdict == "none", str(found)


def test_a_pose_error_traces_as_a_mount_that_is_off(yard: Yard) -> None:
    drive, sensor = opened(yard.drive), load_sensor(yard.sensor)
    tracer, name = FrameTracer(drive, sensor), drive.frames[0]
    pitch, shift = np.radians(0.4), 0.05
    mounted = tracer.trace(
        name,
        (
            find_effect("mount_rotation").model_validate({"pitch_deg": 0.4}),
            find_effect("mount_translation").model_validate({"x_m": shift}),
        ),
    )
    leaning = tracer.trace(name, (), np.array([shift, 0, 0, 0, pitch, 0]))
    there, here = (one.shot.hits.solid for one in (mounted, leaning))
    both = there.exists & here.exists & ~mounted.edge
    assert both.mean() > 0.5
    np.testing.assert_allclose(here.range_m[both], there.range_m[both], rtol=1e-3)
