"""A twin made from labels has mean intensities as reflectances; the loop computes reflectances from them."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.discrepancy.data.frames import FrameTracer, TracedFrame
from cosim.discrepancy.forward.reflectances import intensity_factors, solve_reflectances
from cosim.drives.kitti import Boxes, Drive, Labels, points_in_boxes, write_calibration, write_labels, write_points
from cosim.labelled_twin import write_labelled_twin
from sensors.effects.acting import in_order
from sensors.effects.base import Effect
from sensors.effects.expectation import expect
from sensors.effects.light.detector_compression import DetectorCompression
from sensors.effects.points.intensity_noise import IntensityNoise
from sensors.sensor_model import SensorModel
from tests.cosim.labelled_twin.scans import HEIGHT_M, Block, flat, scan
from tests.cosim.labelled_twin.test_diagnosis import CALIBRATION, PATTERN

ROAD, CAR = 0.1, 0.6  # true reflectances
COMPRESSED = DetectorCompression(gamma=0.5, pivot=0.3)
NOISE = 0.15


def _intensity(reflectance: float, count: int, noise: float) -> np.ndarray:
    compressed = COMPRESSED.pivot * (reflectance / COMPRESSED.pivot) ** COMPRESSED.gamma
    return compressed * (1 + np.random.default_rng(0).normal(0, noise, count))


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Drive:
    folder = tmp_path_factory.mktemp("reflectances")
    root, bottom = folder / "kitti" / "training", -HEIGHT_M
    for part in ("velodyne", "label_2", "calib"):
        (root / part).mkdir(parents=True)
    boxes = Boxes(centre=[[10.0, 2.0, bottom + 0.75]], size=[[4.0, 1.8, 1.5]], yaw=[0.0])
    block = Block(x=(8.0, 12.0), y=(1.1, 2.9), top=bottom + 1.5)
    for number in range(2):
        points, _ = scan(flat, seed=number, blocks=(block,))
        on_car = points_in_boxes(points, boxes, 0.05)[0]
        for reflectance, rows in ((ROAD, ~on_car), (CAR, on_car)):
            points[rows, 3] = _intensity(reflectance, int(rows.sum()), NOISE)
        write_points(root / f"velodyne/{number:06d}.bin", points)
        write_calibration(root / f"calib/{number:06d}.txt", CALIBRATION)
        write_labels(root / f"label_2/{number:06d}.txt", Labels.from_boxes(boxes, ["Car"], CALIBRATION))
    (folder / "pattern.yaml").write_text(PATTERN.to_yaml())
    source = Drive(folder / "kitti")
    write_labelled_twin(source, source.frames, folder / "drive", str(folder / "pattern.yaml"))
    return Drive(folder / "drive")


def _traced(drive: Drive, *effects: Effect) -> TracedFrame:
    tracer = FrameTracer(drive, SensorModel(PATTERN, effects, "known"))
    solve_reflectances(tracer, drive.frames)
    return tracer.trace(drive.frames[0], ())


def _on(frame: TracedFrame, instance: int) -> np.ndarray:
    hits = frame.shot.hits
    is_paint = hits.table.column("paint")[hits.solid.material] | (instance < 0)
    return (hits.solid.instance == instance) & is_paint & frame.observed.trusted & frame.observed.returned


def test_reflectances_are_those_whose_intensities_were_measured(drive: Drive) -> None:
    for effects, road, car in (((COMPRESSED,), ROAD, CAR), ((), np.sqrt(0.3 * ROAD), np.sqrt(0.3 * CAR))):
        frame = _traced(drive, *effects)
        reflectance = frame.shot.hits.reflectance(frame.shot.hits.solid)
        assert reflectance[_on(frame, -1)] == pytest.approx(road, rel=0.03)
        assert reflectance[_on(frame, 0)] == pytest.approx(car, rel=0.15)  # some points are on the edges of the box


def test_only_spread_that_the_sensor_lacks_is_attributed_to_the_twin(drive: Drive) -> None:
    plain, noisy = _traced(drive, COMPRESSED), _traced(drive, COMPRESSED, IntensityNoise(sigma_rel=NOISE))
    road = _on(plain, -1)
    expected = NOISE * np.sqrt(0.3 * ROAD)
    assert plain.twin_sigma_intensity[road] == pytest.approx(expected, rel=0.1)
    assert noisy.twin_sigma_intensity[road].max() < 0.5 * expected


def test_other_effects_give_the_same_mean_intensities_with_other_reflectances(drive: Drive) -> None:
    frame, linear = _traced(drive, COMPRESSED), in_order([])
    assert intensity_factors([frame], (COMPRESSED,), (COMPRESSED,)) is None
    factors = intensity_factors([frame], (COMPRESSED,), linear)
    assert factors is not None
    for instance in (-1, 0):
        rows = _on(frame, instance)
        before, after = (expect(effects, frame.shot).intensity[rows] for effects in ((COMPRESSED,), linear))
        assert (after * factors[0][rows]).mean() == pytest.approx(before.mean(), rel=1e-3)
