"""Two runs on one folder."""

import multiprocessing
import threading
import time

import pytest

from cosim.drives import lock as drive_lock
from cosim.drives.lock import LOCK, LockError, exclusive, shared


def _hold(folder, alone, taken, release):
    with exclusive(folder) if alone else shared(folder):
        taken.set()
        release.wait(30)


@pytest.fixture
def holder(tmp_path):
    """Starts processes that hold the lock until they are ended."""
    context = multiprocessing.get_context("spawn")
    started = []

    def start(alone):
        taken, release = context.Event(), context.Event()
        process = context.Process(target=_hold, args=(tmp_path, alone, taken, release))
        process.start()
        started.append((process, release))
        assert taken.wait(30)
        return process, release

    yield start
    for process, _ in started:
        process.kill()
        process.join()


def test_a_second_run_names_the_running_process(tmp_path, holder, monkeypatch):
    monkeypatch.setattr(drive_lock, "_WAIT_S", 0.2)
    process, _ = holder(alone=True)
    with pytest.raises(LockError, match=f"written by another run .process {process.pid} on "), exclusive(tmp_path):
        pass


def test_a_run_that_was_killed_blocks_no_other_run_and_one_that_ends_leaves_no_file(tmp_path, holder):
    process, _ = holder(alone=True)
    process.kill()
    with exclusive(tmp_path):
        assert (tmp_path / LOCK).exists()
    assert not (tmp_path / LOCK).exists()


def test_a_killed_runs_processes_are_waited_for(tmp_path, holder):
    _, release = holder(alone=False)
    started = time.monotonic()
    threading.Timer(0.5, release.set).start()
    with exclusive(tmp_path):
        assert time.monotonic() - started >= 0.4


def test_processes_of_a_run_join_it(tmp_path, holder):
    with exclusive(tmp_path):
        holder(alone=False)
