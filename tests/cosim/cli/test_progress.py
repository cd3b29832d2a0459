"""Without a terminal long work says now and then what it does, how far it is and how long it will take."""

from __future__ import annotations

import io
import time

import pytest
from rich.console import Console

from cosim.cli import main
from cosim.cli.progress import FrameReport, ProgressReport, duration
from cosim.engine import JobEvent
from cosim.stats import collect


def redirected(quiet: bool = False) -> tuple[Console, io.StringIO]:
    log = io.StringIO()
    return Console(file=log, quiet=quiet), log


def until(log: io.StringIO, words: str) -> str:
    """The first line with some words; waits for it."""
    for _ in range(1000):
        lines = [line for line in log.getvalue().splitlines() if words in line]
        if lines:
            return lines[0]
        time.sleep(0.005)
    raise AssertionError(f"{words!r} is not said: {log.getvalue()}")


def test_a_redirected_command_says_what_it_does_how_far_it_is_and_the_time_left():
    console, log = redirected()
    with ProgressReport(console, "comparing", 8, every_s=0.01) as report:
        assert " so far" in until(log, "comparing, 0 of 8 frames")
        for _ in range(3):
            report.advance()
        assert " left" in until(log, "comparing, 3 of 8 frames, about")


def test_a_part_without_output_is_reported():
    console, log = redirected()
    with ProgressReport(console, "reading", every_s=0.01) as report:
        report.say("fitting range_walk")
        assert " so far" in until(log, "fitting range_walk, ")


def test_short_work_and_quiet_work_say_nothing():
    console, log = redirected()
    with ProgressReport(console, "reading"):
        pass
    assert log.getvalue() == ""
    console, log = redirected(quiet=True)
    with ProgressReport(console, "reading", every_s=0.01):
        time.sleep(0.05)
    assert log.getvalue() == ""


def test_nothing_is_said_any_more_once_the_work_is_over():
    console, log = redirected()
    with pytest.raises(ValueError, match="broken"), ProgressReport(console, "reading", every_s=0.01):
        until(log, "reading")
        raise ValueError("broken")
    message = log.getvalue()
    time.sleep(0.05)
    assert log.getvalue() == message


def test_time_left_is_that_of_what_is_left_at_the_pace_so_far():
    report = ProgressReport(redirected()[0], "training", unit="steps")
    report.reach("epoch 1", 100, 400)  # a resumed training: the first hundred take no time now
    time.sleep(0.05)
    report.reach("epoch 2", 200, 400, "loss 0.100")
    assert report.per_s is not None and 100 / report.per_s >= 0.05
    assert report.line().startswith("epoch 2, 200 of 400 steps, loss 0.100, about ")


def test_frames_are_counted_from_what_workers_tell():
    report = FrameReport(redirected()[0], starting="building the town", working="recording")
    report.start(5, 50)
    assert report.line().startswith("building the town, 5 of 50 frames")
    report.follow(JobEvent("ready"))
    for number in range(3):
        report.follow(JobEvent("frame", f"{number:06d}"))
    assert report.line().startswith("recording, 8 of 50 frames")
    assert report.per_s is not None


def test_a_terminal_sees_a_bar_and_no_lines():
    screen = io.StringIO()
    with ProgressReport(Console(file=screen, force_terminal=True, width=100), "comparing", 4, every_s=0.001) as report:
        for _ in range(4):
            report.advance()
        time.sleep(0.02)
    assert "comparing" in screen.getvalue() and "4/4" in screen.getvalue()
    assert " so far" not in screen.getvalue() and " left" not in screen.getvalue()


@pytest.mark.parametrize(
    ("seconds", "words"), [(0, "0 s"), (59, "59 s"), (59.7, "1 min"), (3599, "1 h 0 min"), (7800, "2 h 10 min")]
)
def test_durations_are_coarse(seconds, words):
    assert duration(seconds) == words


def test_a_command_whose_output_is_redirected_reports_progress(tiny_scans, tmp_path, capsys, monkeypatch):
    def slowly(*args, **keywords):
        time.sleep(0.3)
        return collect(*args, **keywords)

    monkeypatch.setattr("cosim.cli.progress.LINE_EVERY_S", 0.01)
    monkeypatch.setattr("cosim.stats.collect", slowly)
    assert main(["stats", str(tiny_scans), "--out", str(tmp_path / "page")]) == 0
    assert "reading drive, " in capsys.readouterr().err
    assert main(["stats", str(tiny_scans), "--out", str(tmp_path / "page"), "--quiet"]) == 0
    assert capsys.readouterr().err == ""


@pytest.fixture
def tiny_scans(tmp_path):
    from tests.training.tiny_drive import write_drive

    return write_drive(tmp_path / "drive")
