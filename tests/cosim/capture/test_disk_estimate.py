"""Estimate of the disk space of a run before its start."""

import shutil

import pytest

from cosim.capture.config import load_config
from cosim.capture.disk_estimate import DiskError, check_disk_space, estimate_bytes, in_words
from sensors.sensor_model import load_sensor


@pytest.mark.slow
def test_the_estimate_is_within_a_fifth_of_what_a_drive_takes(drive_folder, run_config):
    config = load_config(run_config)
    taken = sum(path.stat().st_size for path in drive_folder.rglob("*") if path.is_file())
    assert estimate_bytes(config, [load_sensor(config.sensor)]) == pytest.approx(taken, rel=0.2)


def test_more_frames_fewer_images_and_no_hits_show(run_config):
    sensor = load_sensor("hdl64e")

    def estimate(**changes):
        return estimate_bytes(load_config(run_config, **changes), [sensor])

    assert estimate(frames=8000) > 100 * estimate(frames=8)
    assert estimate(frames=1000, images=()) < estimate(frames=1000, images=("image_2",)) < estimate(frames=1000)
    assert estimate(frames=1000, store_hits=False) < estimate(frames=1000)


def test_what_does_not_fit_is_refused_before_it_begins(tmp_path):
    free = shutil.disk_usage(tmp_path).free
    check_disk_space(free // 2, tmp_path / "not" / "there")
    with pytest.raises(DiskError, match=r"needs about .* has .* free; record fewer frames"):
        check_disk_space(free * 3, tmp_path / "drive")


@pytest.mark.parametrize(
    ("count", "words"), [(12, "12 bytes"), (51e9, "51 GB"), (2.5e15, "2.5e+03 TB"), (3400, "3.4 kB")]
)
def test_sizes_in_words(count, words):
    assert in_words(count) == words
