"""What is known of KITTI's own LiDAR is found in its recordings, from a model that knows none of it."""

from __future__ import annotations

import csv
import lzma
import shutil
from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy import diagnose
from cosim.discrepancy.analysis import FittedFrames, context_of, trace_and_fit
from cosim.drives.kitti import Drive
from cosim.labelled_twin import write_labelled_twin
from sensors.effects.base import Effect
from sensors.effects.beams.dual_block import DualBlock
from sensors.effects.beams.elevation_offset import ElevationOffset
from sensors.effects.beams.ring_elevation import RingElevation
from sensors.effects.points.range_noise import RangeNoise
from sensors.sensor_model import load_sensor

pytestmark = pytest.mark.slow
UPPER_M, LOWER_M = 0.2035, 0.1214  # means of the lasers of each block
PLAIN = load_sensor("hdl64e_single")


def recorded(source: Path, folder: Path, count: int) -> Drive:
    """Some frames that may be fitted, evenly spread over the drives, with twins made from labels."""
    listed = (source / "ImageSets" / "fit.txt").read_text().split()
    names = [listed[row] for row in np.linspace(0, len(listed) - 1, count).round().astype(int)]
    for part in ("velodyne", "label_2", "calib"):
        (folder / "kitti" / "training" / part).mkdir(parents=True)
    for name in names:
        for part in ("label_2", "calib"):
            shutil.copy(source / part / f"{name}.txt", folder / "kitti" / "training" / part)
        packed = (source / "velodyne" / f"{name}.bin.xz").read_bytes()
        (folder / "kitti" / "training" / "velodyne" / f"{name}.bin").write_bytes(lzma.decompress(packed))
    write_labelled_twin(Drive(folder / "kitti"), names, folder / "drive")
    return Drive(folder / "drive")


def table(source: Path) -> np.ndarray:
    """Elevation of every laser [°] as recovered from 155 scans, top first."""
    with (source / "statistics" / "kitti_hdl64e_per_laser.csv").open() as file:
        return np.array([float(row["vert_angle_deg"]) for row in csv.DictReader(file)])


def check_lasers(blocks: DualBlock, rings: RingElevation, true_deg: np.ndarray) -> None:
    assert blocks.upper_m == pytest.approx(UPPER_M, abs=0.01)
    assert blocks.lower_m == pytest.approx(LOWER_M, abs=0.01)
    errors_deg = true_deg - np.array(PLAIN.pattern.elevation_deg)
    found_deg = np.array(rings.offsets_deg)
    assert np.corrcoef(found_deg, errors_deg)[0, 1] > 0.999
    assert np.sqrt(np.mean((found_deg - errors_deg) ** 2)) < 0.05  # lasers of a block are up to 6 mm from their mean


class Fits:
    """Joint fits to one drive."""

    def __init__(self, drive: Drive) -> None:
        self.context, self.names = context_of(drive, PLAIN), drive.frames

    def fit(self, effects: tuple[Effect, ...]) -> FittedFrames:
        return trace_and_fit(self.context, self.names, effects, range(len(effects)))


def test_where_lasers_stand_and_look_and_how_much_all_look_too_low(kitti_source: Path, tmp_path: Path) -> None:
    fits = Fits(recorded(kitti_source, tmp_path, 6))
    start = (RingElevation(offsets_deg=(0.0,) * 64), DualBlock(upper_m=0.0, lower_m=0.0), RangeNoise(sigma_m=0.1))
    rings, blocks, noise = fits.fit(start).fitted.effects
    assert isinstance(rings, RingElevation) and isinstance(blocks, DualBlock)
    check_lasers(blocks, rings, table(kitti_source))
    found = fits.fit((ElevationOffset(offset_deg=0.0), rings, blocks, noise)).fitted.effects
    assert isinstance(found[0], ElevationOffset)
    assert 0.1 < found[0].offset_deg < 0.3


@pytest.mark.slow
def test_a_diagnosis_finds_them_blind(kitti_source: Path, tmp_path: Path) -> None:
    found = diagnose(recorded(kitti_source, tmp_path, 60), PLAIN)
    effects = {effect.name: effect for effect in found.sensor.effects}
    assert {"dual_block", "ring_elevation", "ring_gain", "elevation_offset"} <= set(effects)
    blocks, rings, offset = (effects[name] for name in ("dual_block", "ring_elevation", "elevation_offset"))
    assert isinstance(blocks, DualBlock) and isinstance(rings, RingElevation) and isinstance(offset, ElevationOffset)
    check_lasers(blocks, rings, table(kitti_source))
    assert 0.1 < offset.offset_deg < 0.3
    most = {"intensity_quantization": 1.001, "dual_block": 1.05}  # errors do not depend on rounding and rises
    for one in found.effects:
        assert one.error_after.error < most.get(one.effect, 1.0) * one.error_before.error
    assert found.error_after < 0.06 * found.error_before
