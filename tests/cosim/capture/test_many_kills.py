"""A long run that is killed again and again ends with the bytes of an undisturbed one."""

import os
import random
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

from tests.cosim.capture.test_run import checksums, start_run
from tests.cosim.conftest import cosim
from tests.cosim.engine.test_cluster import Cluster, cluster, kill_group

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("kills")]
_FRAMES = 500
_KILLS = 50
_DASK_KILLS = 10
_CONFIG = f"town: town01\nframes: {_FRAMES}\nseed: 5\nframes_per_episode: 10\nimages: []\nwarm_up_s: 5\n"


@pytest.fixture(scope="module")
def config(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("config") / "run.yaml"
    path.write_text(_CONFIG)
    return path


@pytest.fixture(scope="module")
def undisturbed(config, tmp_path_factory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("undisturbed") / "drive"
    cosim("run", config, "--out", folder, "--workers", 2, "--quiet", timeout=3600)
    sums = checksums(folder)
    shutil.rmtree(folder)
    assert sum(name.startswith("velodyne/") for name in sums) == _FRAMES
    return sums


def frames_listed(folder: Path) -> int:
    manifest = folder / "manifest.jsonl"
    return manifest.read_bytes().count(b"\n") if manifest.is_file() else 0


def test_fifty_kills_at_random_instants(config, undisturbed, tmp_path):
    folder, chance = tmp_path / "drive", random.Random(8)
    kills = 0
    while kills < _KILLS:
        process = start_run(config, folder, "--workers", "2")
        # Some while it starts, most while it records, and so that there is always something left for the last ones.
        least = frames_listed(folder) + (0 if chance.random() < 0.3 else 1)
        deadline = time.monotonic() + 600
        while frames_listed(folder) < least and process.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        time.sleep(chance.uniform(0.0, 1.5))
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            kills += 1
        process.wait()
        assert not (folder / "drive.yaml").exists(), f"the run was over after {kills} kills"
    cosim("run", config, "--out", folder, "--workers", 2, "--quiet", timeout=3600)
    assert checksums(folder) == undisturbed


def test_dask_workers_that_are_killed_again_and_again(config, undisturbed, tmp_path):
    folder, chance = tmp_path / "drive", random.Random(9)
    with cluster(tmp_path / "scratch") as dask:
        workers = [dask.worker(), dask.worker()]
        run = start_run(config, folder, "--engine", "dask", "--address", dask.address)
        for kill in range(_DASK_KILLS):
            _wait_for(folder, (kill + 1) * _FRAMES // (_DASK_KILLS + 2), run)
            time.sleep(chance.uniform(0.0, 2.0))
            workers = _replaced(dask, workers, chance)
        assert run.wait(3600) == 0
    assert checksums(folder) == undisturbed


def _wait_for(folder: Path, count: int, run: subprocess.Popen[str]) -> None:
    deadline = time.monotonic() + 1800
    while frames_listed(folder) < count:
        assert run.poll() is None and time.monotonic() < deadline
        time.sleep(0.05)


def _replaced(dask: Cluster, workers: list[subprocess.Popen[bytes]], chance: random.Random) -> list:
    """The workers, one of which is killed and another started in its stead."""
    victim = workers.pop(chance.randrange(len(workers)))
    kill_group(victim)
    return [*workers, dask.worker()]
