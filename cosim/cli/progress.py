"""What a long command is doing, how far it is and how long it will take.

On a terminal that is a bar; elsewhere, in a log or a pipe, a line a minute on stderr, so that ten minutes of work are
never ten minutes of silence. With `--quiet` it is nothing.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from cosim.engine import Event

if TYPE_CHECKING:
    from training.loop import Moment

LINE_EVERY_S = 60.0


class ProgressReport:
    """Tells of one command's work, piece after piece; use it as a context.

    A piece is counted (`total` is known) or not. Lines are written by a thread of their own, also while a piece is
    silent for long, and none before the first interval is over: short commands stay without.

    Args:
        console: of the command; a quiet one keeps all of it silent.
        doing: the first piece, such as `reading frames`.
        total: how many of `unit` there are, if known.
        unit: what is counted, in the plural.
        every_s: time between lines; a minute by default.
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
        self._begun_s = time.monotonic()
        self._first_s: float | None = None
        self._first_done = 0
        self._last_s = self._begun_s
        self._over = threading.Event()
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
        self._over.set()
        if self._bar is not None:
            self._bar.stop()
        if self._thread is not None:
            self._thread.join()

    @property
    def per_s(self) -> float | None:
        """How many of the piece's unit are done a second, counted from the first on; None before the second."""
        if self._first_s is None or self._done <= self._first_done:
            return None
        return (self._done - self._first_done) / max(self._last_s - self._first_s, 1e-9)

    def begin(self, doing: str, total: int | None = None, done: int = 0) -> None:
        """Go on to another piece of work, some of which may be done already."""
        with self._lock:
            self._doing, self._total, self._done, self._note = doing, total, done, ""
            self._first_s = None
        self._show()

    def say(self, doing: str) -> None:
        """Name what is being done now, and let what is counted be."""
        with self._lock:
            self._doing = doing
        self._show()

    def advance(self, note: str = "") -> None:
        """Count one more, and say something of it."""
        with self._lock:
            self._done, self._note, self._last_s = self._done + 1, note, time.monotonic()
            if self._first_s is None:
                self._first_s, self._first_done = self._last_s, self._done
        self._show()

    def reach(self, doing: str, done: int, total: int, note: str = "") -> None:
        """Be `done` of `total` on the way; steps that were done before the first call cost no time."""
        with self._lock:
            fresh = self._total != total or done <= self._done
            self._doing, self._done, self._total, self._note = doing, done, total, note
            self._last_s = time.monotonic()
            if fresh or self._first_s is None:
                self._first_s, self._first_done = self._last_s, done
        self._show()

    def line(self) -> str:
        """The state in one line: what, how far, time left."""
        with self._lock:
            parts = [self._doing]
            if self._total:
                parts.append(f"{self._done:,} of {self._total:,} {self._unit}")
            elif self._done:
                parts.append(f"{self._done:,} {self._unit}")
            if self._note:
                parts.append(self._note)
            left_s = self._left_s()
            spent_s = time.monotonic() - self._begun_s
            parts.append(f"{duration(spent_s)} so far" if left_s is None else f"about {duration(left_s)} left")
        return ", ".join(parts)

    def _left_s(self) -> float | None:
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
        while not self._over.wait(self._every_s):
            self._console.print(self.line(), soft_wrap=True, highlight=False, markup=False)


class FrameReport(ProgressReport):
    """Frames that workers record.

    Args:
        console: of the command.
        starting: what is done before the first worker is ready.
        working: what is done then.
        every_s: time between lines; a minute by default.
    """

    def __init__(self, console: Console, *, starting: str, working: str, every_s: float | None = None) -> None:
        super().__init__(console, starting, every_s=every_s)
        self._working = working

    def start(self, done: int, total: int) -> None:
        """Begin, with some of the frames there already."""
        self.begin(self._doing, total, done)

    def follow(self, event: Event) -> None:
        """Count what a worker tells."""
        if event.kind == "ready":
            self.say(self._working)
        elif event.kind == "frame":
            self.advance()


def steps_told(report: ProgressReport, of: str = "") -> Callable[[Moment], None]:
    """Tells of a training's steps; what is not a step, such as scoring, shows as the last one."""

    def on_step(moment: Moment) -> None:
        report.reach(f"{of}epoch {moment.epoch}", moment.step, moment.steps, f"loss {moment.losses['total']:.3f}")

    return on_step


def duration(seconds: float) -> str:
    """A time span in words, coarse: `40 s`, `3 min`, `2 h 10 min`."""
    minutes = round(seconds / 60)
    if seconds < 59.5:
        return f"{seconds:.0f} s"
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"
