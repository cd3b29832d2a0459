"""Processes of this machine that die, hang or fail, and what becomes of their tasks."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cosim.engine import JobEvent, LocalEngine, WorkError
from tests.cosim.engine.mishaps import Mishaps, Task


def shared_out(folder, tasks, workers=2, patience_s=60.0):
    events: list[JobEvent] = []
    skipped = LocalEngine(workers, patience_s).share_out(Mishaps(folder), tasks, events.append)
    return skipped, events


def done(folder):
    return {path.name for path in folder.iterdir() if "." not in path.name}


def test_every_task_is_done_once_and_processes_are_used_again(tmp_path):
    tasks = [Task(f"t{number}") for number in range(9)]
    skipped, events = shared_out(tmp_path, tasks)
    assert not skipped
    assert done(tmp_path) == {task.name for task in tasks}
    assert len(list(tmp_path.glob("opened.*"))) == 2
    assert all(len(list(tmp_path.glob(f"{task.name}.*"))) == 1 for task in tasks)
    assert sorted(event.text for event in events if event.kind == "frame") == sorted(done(tmp_path))


def test_memory_is_reported_with_every_task(tmp_path):
    _, events = shared_out(tmp_path, [Task("a"), Task("b")], workers=1)
    peaks = [event.peak_bytes for event in events if event.kind == "task"]
    assert len(peaks) == 2 and all(5e6 < peak < 2e9 for peak in peaks)


def _patience_s(mishap: str) -> float:
    """Time without a report [s] until a process is given up; short only if it is what is tested."""
    return 2.0 if mishap == "stopped" else 60.0


@pytest.mark.parametrize("mishap", ["killed", "stopped", "exits", "error"])
def test_a_task_whose_process_fails_once_is_done_by_another(tmp_path, mishap):
    tasks = [Task("a"), Task("b", mishap), Task("c")]
    skipped, events = shared_out(tmp_path, tasks, patience_s=_patience_s(mishap))
    assert not skipped
    assert done(tmp_path) == {"a", "b", "c"}
    assert len(list(tmp_path.glob("b.*"))) == 2
    assert [event.kind for event in events].count("again") == 1


@pytest.mark.parametrize(
    ("mishap", "reason"),
    [
        ("killed", "killed by signal 9"),
        ("stopped", "did not report for 2 s"),
        ("exits", "exit code 3"),
        ("error", "ZeroDivisionError: the road is of no length"),
    ],
)
def test_a_task_that_fails_twice_is_skipped_with_its_reason(tmp_path, mishap, reason):
    tasks = [Task("a"), Task("b", mishap, always=True), Task("c")]
    skipped, events = shared_out(tmp_path, tasks, patience_s=_patience_s(mishap))
    assert [skip.task.name for skip in skipped] == ["b"] and reason in skipped[0].reason
    assert done(tmp_path) == {"a", "c"}
    assert [event.kind for event in events].count("skipped") == 1


def test_a_long_task_that_says_it_is_at_work_is_not_given_up(tmp_path):
    skipped, events = shared_out(tmp_path, [Task("a", "long")], patience_s=2.0)
    assert not skipped and done(tmp_path) == {"a"} and "again" not in [event.kind for event in events]


def test_a_users_mistake_ends_all_work_at_once(tmp_path):
    with pytest.raises(WorkError, match="speed is -3; give 0 or more"):
        shared_out(tmp_path, [Task("a", "refused"), Task("b", "slow")])


def test_a_task_is_made_anew_before_its_second_attempt(tmp_path):
    engine = LocalEngine(1)
    engine.share_out(
        Mishaps(tmp_path),
        [Task("a", "killed")],
        lambda event: None,
        refresh_task=lambda task: Task(task.name + "-again"),
    )
    assert done(tmp_path) == {"a-again"}


def test_processes_end_with_a_parent_that_is_killed(tmp_path):
    code = (
        "import sys; from pathlib import Path; from cosim.engine import LocalEngine;"
        "from tests.cosim.engine.mishaps import Mishaps, Task;"
        "LocalEngine(2).share_out(Mishaps(Path(sys.argv[1])), [Task('a', 'slow'), Task('b', 'slow')], print)"
    )
    parent = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], env={**os.environ, "PYTHONPATH": "."})
    deadline = time.monotonic() + 60
    while len(list(tmp_path.glob("[ab].*"))) < 2:
        assert parent.poll() is None and time.monotonic() < deadline
        time.sleep(0.05)
    children = [int(path.suffix[1:]) for path in tmp_path.glob("opened.*")]
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    deadline = time.monotonic() + 10
    while any(_lives(pid) for pid in children):
        assert time.monotonic() < deadline, "children outlive their parent"
        time.sleep(0.05)
    assert not done(tmp_path)


def test_workers_are_at_least_one():
    with pytest.raises(WorkError, match="workers is 0; give 1 or more"):
        LocalEngine(0)


def _lives(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
