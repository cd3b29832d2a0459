"""A calibrated sensor in the formats of drivers: directions that these files describe are those of the sensor file."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from cosim.errors import CosimError
from cosim.export.sensor_calibration import laser_table, write_calibration
from sensors.effects.beams.dual_block import DualBlock
from sensors.effects.beams.elevation_offset import ElevationOffset
from sensors.effects.points.range_bias import RangeBias
from sensors.pattern import load_pattern
from sensors.sensor_model import SensorModel

OFFSET_DEG, BIAS_M = 0.2, 0.03


@pytest.fixture
def sensor() -> SensorModel:
    effects = (ElevationOffset(offset_deg=OFFSET_DEG), DualBlock(upper_m=0.2, lower_m=0.12), RangeBias(offset_m=BIAS_M))
    return SensorModel(load_pattern("hdl64e_kitti"), effects)


def test_all_formats_describe_the_same_beams(sensor: SensorModel, tmp_path: Path) -> None:
    write_calibration(sensor, tmp_path)
    wanted = np.array(sensor.pattern.elevation_deg) + OFFSET_DEG
    fan = np.array(sensor.pattern.azimuth_offset_deg)
    velodyne = yaml.safe_load((tmp_path / "velodyne.yaml").read_text())
    lasers = velodyne["lasers"]
    assert velodyne["num_lasers"] == len(lasers) == 64
    np.testing.assert_allclose(np.degrees([one["vert_correction"] for one in lasers]), wanted, atol=1e-4)
    np.testing.assert_allclose(np.degrees([one["rot_correction"] for one in lasers]), fan, atol=1e-4)
    assert {round(one["vert_offset_correction"], 4) for one in lasers} == {0.2, 0.12}
    assert all(one["dist_correction"] == pytest.approx(-BIAS_M) for one in lasers)
    rows = list(csv.DictReader((tmp_path / "hesai.csv").open()))
    assert [int(row["Channel"]) for row in rows] == list(range(1, 65))
    np.testing.assert_allclose([float(row["Elevation"]) for row in rows], wanted, atol=1e-3)
    np.testing.assert_allclose([-float(row["Azimuth"]) for row in rows], fan, atol=1e-3)
    ouster = json.loads((tmp_path / "ouster.json").read_text())["beam_intrinsics"]
    np.testing.assert_allclose(ouster["beam_altitude_angles"], wanted, atol=1e-3)
    ncore = np.load(tmp_path / "ncore.npz")
    np.testing.assert_allclose(np.degrees(ncore["row_elevations_rad"]), wanted, atol=1e-3)
    assert len(ncore["column_azimuths_rad"]) == sensor.pattern.firings


def test_a_decoder_of_others_reads_the_velodyne_file(sensor: SensorModel, tmp_path: Path) -> None:
    decoder = pytest.importorskip("velodyne_decoder")
    write_calibration(sensor, tmp_path)
    read = decoder.Calibration.read(str(tmp_path / "velodyne.yaml"))
    lasers = sorted(yaml.safe_load(read.to_string())["lasers"], key=lambda one: one["laser_id"])
    elevation = np.degrees([one["vert_correction"] for one in lasers])
    np.testing.assert_allclose(elevation, laser_table(sensor).elevation_deg, atol=1e-4)


def test_a_template_keeps_the_drivers_numbers_and_one_of_another_sensor_is_refused(
    sensor: SensorModel, tmp_path: Path
) -> None:
    order = np.random.default_rng(0).permutation(64)
    elevation = np.array(sensor.pattern.elevation_deg)
    lines = [f"{number + 1},{elevation[row]:.3f},0" for number, row in enumerate(order)]
    template = tmp_path / "driver.csv"
    template.write_text("Channel,Elevation,Azimuth\n" + "\n".join(lines) + "\n")
    write_calibration(sensor, tmp_path / "out", template)
    rows = list(csv.DictReader((tmp_path / "out/hesai.csv").open()))
    np.testing.assert_allclose([float(row["Elevation"]) for row in rows], elevation[order] + OFFSET_DEG, atol=2e-3)
    template.write_text("Channel,Elevation,Azimuth\n1,5,0\n2,4,0\n")
    with pytest.raises(CosimError, match="do not match"):
        write_calibration(sensor, tmp_path / "other", template)
    assert not (tmp_path / "other").exists()
