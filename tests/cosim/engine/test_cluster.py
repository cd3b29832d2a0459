"""A Dask scheduler and workers on loopback, and what becomes of tasks when workers die."""

import os
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

from cosim.engine import JobEvent, WorkError
from cosim.engine.cluster import DaskEngine, _group
from tests.cosim.capture.test_run import checksums, wait_for_frames
from tests.cosim.conftest import refused
from tests.cosim.engine.mishaps import Mishaps, Task

pytest.importorskip("distributed")


class Cluster:
    """Processes as `dask scheduler` and `dask worker` start them."""

    def __init__(self, scratch: Path) -> None:
        self._scratch = scratch
        self._environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        port = self.address.rpartition(":")[2]
        self._processes = [self._started("scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard")]

    def worker(self) -> subprocess.Popen[bytes]:
        process = self._started(
            "worker", self.address, "--nthreads", "1", "--no-dashboard", "--local-directory", str(self._scratch)
        )
        self._processes.append(process)
        return process

    def lose_scheduler(self) -> None:
        kill_group(self._processes[0])

    def end(self) -> None:
        for process in self._processes:
            kill_group(process)

    def _started(self, *command: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", "dask", *command],
            env=self._environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )


def kill_group(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@contextmanager
def cluster(scratch: Path):
    started = Cluster(scratch)
    try:
        yield started
    finally:
        started.end()


def done(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir() if "." not in path.name}


@pytest.mark.slow
def test_tasks_survive_children_that_die_and_workers_that_join_late(tmp_path):
    (tmp_path / "tasks").mkdir()
    events: list[JobEvent] = []
    tasks = [Task("a"), Task("b", "killed"), Task("c", "error", always=True), Task("d"), Task("e", "stopped")]
    with cluster(tmp_path / "scratch") as dask:
        dask.worker()
        skipped = DaskEngine(dask.address, patience_s=4.0).share_out(Mishaps(tmp_path / "tasks"), tasks, events.append)
    assert [skip.task.name for skip in skipped] == ["c"] and "of no length" in skipped[0].reason
    assert done(tmp_path / "tasks") == {"a", "b", "d", "e"}
    types = [event.kind for event in events]
    assert types.count("task") == 4 and types.count("again") == 3 and types.count("skipped") == 1


def test_groups_are_neighbours_of_one_world():
    tasks = [Task(str(number), affinity=(world,)) for number, world in enumerate("aaaaaabbc")]
    names = ["".join(task.name for task in group) for group in _group(tasks, 20)]
    assert names == ["0123", "45", "67", "8"]
    assert ["".join(task.name for task in group) for group in _group(tasks, 2)] == ["01", "23", "45", "67", "8"]
    assert [len(group) for group in _group(tasks, 0)] == [1] * 9
    assert [len(group) for group in _group([Task("a"), Task("b")], 4)] == [1, 1]


def test_a_group_goes_on_after_a_task_that_fails(tmp_path):
    (tmp_path / "tasks").mkdir()
    events: list[JobEvent] = []
    worlds = "wxyz"
    tasks = [Task(f"{world}{number}", affinity=(world,)) for world in worlds for number in range(4)]
    tasks[1] = Task("w1", "killed", affinity=("w",))
    tasks[5] = Task("x1", "error", always=True, affinity=("x",))
    with cluster(tmp_path / "scratch") as dask:
        dask.worker()
        skipped = DaskEngine(dask.address).share_out(Mishaps(tmp_path / "tasks"), tasks, events.append)
    assert [skip.task.name for skip in skipped] == ["x1"]
    assert done(tmp_path / "tasks") == {task.name for task in tasks} - {"x1"}
    processes = {name: (tmp_path / "tasks" / name).read_text() for name in done(tmp_path / "tasks")}
    for world in "yz":
        assert len({process for name, process in processes.items() if name[0] == world}) == 1
    assert [event.kind for event in events].count("task") == 15
    assert [event.kind for event in events].count("again") == 2


@pytest.mark.slow
def test_a_drive_recorded_by_workers_that_are_killed_has_the_same_bytes(blind_drive, blind_config, tmp_path):
    folder = tmp_path / "drive"
    with cluster(tmp_path / "scratch") as dask:
        first = dask.worker()
        code = "import sys; from cosim.cli import main; sys.exit(main())"
        options = ["--engine", "dask", "--address", dask.address, "--quiet"]
        run = subprocess.Popen(
            [sys.executable, "-c", code, "run", str(blind_config), "--out", str(folder), *options], text=True
        )
        wait_for_frames(folder, 2, run)
        kill_group(first)
        dask.worker()
        assert run.wait(300) == 0
    assert checksums(folder) == checksums(blind_drive)


@pytest.mark.slow
def test_a_lost_scheduler_is_reported(tmp_path):
    (tmp_path / "tasks").mkdir()
    with cluster(tmp_path / "scratch") as dask:
        dask.worker()

        def on_event(event: JobEvent) -> None:
            if event.text == "a":
                dask.lose_scheduler()

        with pytest.raises(WorkError, match=r"connection to the Dask scheduler at .* is lost; start it again"):
            DaskEngine(dask.address).share_out(Mishaps(tmp_path / "tasks"), [Task("a"), Task("b", "slow")], on_event)


def test_a_users_mistake_reaches_the_user(tmp_path):
    (tmp_path / "tasks").mkdir()
    with cluster(tmp_path / "scratch") as dask:
        dask.worker()
        with pytest.raises(WorkError, match="speed is -3"):
            DaskEngine(dask.address).share_out(Mishaps(tmp_path / "tasks"), [Task("a", "refused")], lambda event: None)


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--engine", "dask"], "--engine dask needs the address of its scheduler"),
        (["--engine", "dask", "--address", "tcp://127.0.0.1:1"], "no Dask scheduler answers at tcp://127.0.0.1:1"),
        (["--engine", "dask", "--address", "nonsense://x"], "'nonsense://x' is not the address of a Dask scheduler"),
        (["--address", "tcp://127.0.0.1:1"], "--address applies only to --engine dask"),
    ],
)
def test_addresses_without_a_scheduler(tmp_path, monkeypatch, options, complaint):
    monkeypatch.setattr("cosim.engine.cluster._CONNECT_S", 1)
    assert complaint in refused("run", "--frames", 1, "--out", tmp_path / "d", *options)
