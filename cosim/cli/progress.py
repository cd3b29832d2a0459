"""A bar of frames done, with their rate."""

from __future__ import annotations

import time

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from cosim.engine import Event


def step_bar(console: Console, *, shown: bool, transient: bool = False) -> Progress:
    """A bar of training steps; its tasks have a field `loss` of words."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[loss]}"),
        TimeRemainingColumn(),
    )
    return Progress(*columns, console=console, disable=not shown, transient=transient)


class FrameBar:
    """Frames done, frames a second and the time left; a second is counted from the first frame on."""

    def __init__(self, console: Console, *, starting: str, working: str) -> None:
        self._starting, self._working = starting, working
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[rate]}"),
            TimeRemainingColumn(),
            console=console,
            disable=not console.is_terminal,
        )
        self._task = self._progress.add_task("starting", total=None, rate="")
        self._first: float | None = None
        self._since_first = 0
        self.frames_per_s: float | None = None

    def __enter__(self) -> FrameBar:
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def start(self, done: int, total: int) -> None:
        """Begin, with some of the frames there already."""
        self._progress.start()
        self._progress.update(self._task, total=total, completed=done, description=self._starting)

    def follow(self, event: Event) -> None:
        """Count what a worker tells."""
        if event.kind == "ready":
            self._progress.update(self._task, description=self._working)
        if event.kind != "frame":
            return
        now = time.monotonic()
        if self._first is None:
            self._first = now
        else:
            self._since_first += 1
            self.frames_per_s = self._since_first / max(now - self._first, 1e-9)
        rate = "" if self.frames_per_s is None else f"{self.frames_per_s:.1f} frames/s"
        self._progress.update(self._task, advance=1, rate=rate)
