"""Progress reports of long commands: current step, progress and remaining time.

On a terminal a progress bar is shown. Otherwise (in a log or a pipe) one line per minute is written to stderr. With
`--quiet` nothing is shown.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from cosim.engine import JobEvent

if TYPE_CHECKING:
    from training.loop import Moment

LINE_EVERY_S = 60.0


class ProgressReport:
    """Reports the progress of a command through its steps; a context manager.

    A step is counted if its `total` is known. Lines are written by a separate thread, also during a step that does not
    report, and not before the first interval is over.

    Args:
        console: console of the command; nothing is shown on a quiet one.
        doing: first step, for example `reading frames`.
        total: number of items in the step, if known.
        unit: plural name of the items.
        every_s: time between lines; one minute by default [s].
    """

    def __init__(
        self,
        console: Console,
        doing: str,
        total: int | None = None,
        *,
        unit: str = "frames",
        every_s: float | None = None,
    ) -> None:
        self._console, self._unit = console, unit
        self._every_s = LINE_EVERY_S if every_s is None else every_s
        self._doing, self._total, self._done, self._note = doing, total, 0, ""
        self._start_s = time.monotonic()
        self._first_s: float | None = None
        self._first_done = 0
        self._last_s = self._start_s
        self._is_over = threading.Event()
        self._lock = threading.Lock()
        self._bar: Progress | None = None
        self._task = TaskID(0)
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            columns = (TextColumn("{task.description}", markup=False), BarColumn(), TextColumn("{task.fields[count]}"))
            times = (TimeElapsedColumn(), TimeRemainingColumn())
            self._bar = Progress(*columns, *times, console=self._console, transient=True)
            self._task = self._bar.add_task(self._doing, total=self._total, count="")
            self._bar.start()
        elif not self._console.quiet:
            self._thread = threading.Thread(target=self._write_lines, daemon=True)
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        if self._bar is not None:
            self._bar.stop()
        if self._thread is not None:
            self._thread.join()

    @property
    def per_s(self) -> float | None:
        """Items per second since the first item of the step; None before the second item."""
        if self._first_s is None or self._done <= self._first_done:
            return None
        return (self._done - self._first_done) / max(self._last_s - self._first_s, 1e-9)

    def begin(self, doing: str, total: int | None = None, done: int = 0) -> None:
        """Start another step, of which `done` items exist already."""
        with self._lock:
            self._doing, self._total, self._done, self._note = doing, total, done, ""
            self._first_s = None
        self._show()

    def say(self, doing: str) -> None:
        """Show another description; the count is unchanged."""
        with self._lock:
            self._doing = doing
        self._show()

    def advance(self, note: str = "") -> None:
        """Count one more item; `note` is shown with it."""
        with self._lock:
            self._done, self._note, self._last_s = self._done + 1, note, time.monotonic()
            if self._first_s is None:
                self._first_s, self._first_done = self._last_s, self._done
        self._show()

    def reach(self, doing: str, done: int, total: int, note: str = "") -> None:
        """Set the count to `done` of `total`; items before the first call are not used for the remaining time."""
        with self._lock:
            is_new_step = self._total != total or done <= self._done
            self._doing, self._done, self._total, self._note = doing, done, total, note
            self._last_s = time.monotonic()
            if is_new_step or self._first_s is None:
                self._first_s, self._first_done = self._last_s, done
        self._show()

    def line(self) -> str:
        """Progress in one line: step, count, remaining time."""
        with self._lock:
            parts = [self._doing]
            if self._total:
                parts.append(f"{self._done:,} of {self._total:,} {self._unit}")
            elif self._done:
                parts.append(f"{self._done:,} {self._unit}")
            if self._note:
                parts.append(self._note)
            remaining_s = self._remaining_s()
            elapsed_s = time.monotonic() - self._start_s
            parts.append(
                f"{duration(elapsed_s)} so far" if remaining_s is None else f"about {duration(remaining_s)} left"
            )
        return ", ".join(parts)

    def _remaining_s(self) -> float | None:
        per_s = self.per_s
        return None if not per_s or not self._total else (self._total - self._done) / per_s

    def _show(self) -> None:
        if self._bar is None:
            return
        rate = "" if self.per_s is None or self._note else f"{self.per_s:.1f} {self._unit}/s"
        count = f"{self._done:,}/{self._total:,} {self._note or rate}" if self._total else self._note
        self._bar.update(
            self._task, description=self._doing, total=self._total, completed=self._done, count=count.strip()
        )

    def _write_lines(self) -> None:
        while not self._is_over.wait(self._every_s):
            self._console.print(self.line(), soft_wrap=True, highlight=False, markup=False)


class FrameReport(ProgressReport):
    """Progress of frames that worker processes record.

    Args:
        console: console of the command.
        starting: description until the first worker is ready.
        working: description after that.
        every_s: time between lines; one minute by default [s].
    """

    def __init__(self, console: Console, *, starting: str, working: str, every_s: float | None = None) -> None:
        super().__init__(console, starting, every_s=every_s)
        self._working = working

    def start(self, done: int, total: int) -> None:
        """Start with `done` existing frames of `total`."""
        self.begin(self._doing, total, done)

    def follow(self, event: JobEvent) -> None:
        """Update the progress with an event of a worker."""
        if event.kind == "ready":
            self.say(self._working)
        elif event.kind == "frame":
            self.advance()


def training_progress(report: ProgressReport, of: str = "") -> Callable[[Moment], None]:
    """Return a callback that reports training steps; `of` is a prefix of the description."""

    def on_step(moment: Moment) -> None:
        report.reach(f"{of}epoch {moment.epoch}", moment.step, moment.steps, f"loss {moment.losses['total']:.3f}")

    return on_step


def duration(seconds: float) -> str:
    """Format a duration coarsely: `40 s`, `3 min`, `2 h 10 min`."""
    minutes = round(seconds / 60)
    if seconds < 59.5:
        return f"{seconds:.0f} s"
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"
