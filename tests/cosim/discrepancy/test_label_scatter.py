"""Labels that are off show in what objects' ranges share, and then ranges on objects are unsure."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy.checks import opened
from cosim.discrepancy.frames import FrameTracer, TracedFrame, in_order
from cosim.discrepancy.settling import settle
from sensors.effects.registry import find_effect
from sensors.sensor_model import load_sensor
from tests.cosim.discrepancy.conftest import NOISE
from tests.cosim.discrepancy.small_drive import Yard, make_yard

FRAMES = 16


def _settled(yard: Yard) -> list[TracedFrame]:
    drive, sensor = opened(yard.drive), load_sensor(yard.sensor)
    tracer = FrameTracer(drive, sensor)
    names = tuple(drive.frames)
    effects = in_order(sensor.effects)
    trace = lambda bent, leaning: tracer.trace_all(names, bent, leaning)  # noqa: E731
    return settle(tracer.trace_all(names, ()), trace, effects, (), seed=0).frames


@pytest.fixture
def yard(tmp_path: Path) -> Yard:
    noise = find_effect("range_noise").model_validate({"sigma_m": 0.01})
    return make_yard(tmp_path, (noise,), known=(NOISE,), frames=FRAMES)


def test_exact_labels_are_taken_for_exact(yard: Yard) -> None:
    for frame in _settled(yard):
        assert frame.label_scatter_m == 0
        assert not frame.unsure_m.any()


def test_labels_off_by_a_decimetre_make_objects_unsure_and_nothing_else(yard: Yard) -> None:
    rng = np.random.default_rng(5)
    for path in sorted((yard.drive / "twin/frames").glob("*.json")):
        told = json.loads(path.read_text())
        for row in (0, 1):
            told["instances"][0]["pose"][row][3] += 0.1 * rng.standard_normal()
        path.write_text(json.dumps(told))
    for frame in _settled(yard):
        assert 0.04 < frame.label_scatter_m < 0.2
        of_object = frame.shot.hits.solid.instance >= 0
        assert (frame.unsure_m[of_object] >= frame.label_scatter_m * 0.99).all()
        assert not frame.unsure_m[~of_object].any()
        assert frame.exact is not None
        assert (frame.edge >= frame.exact.edge).all()
        assert frame.edge.mean() < 1.5 * frame.exact.edge.mean()


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
