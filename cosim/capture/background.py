"""Write files in a background thread while the next frame is computed."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor


class BackgroundWriter:
    """Runs tasks in one background thread, in the order of submission."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1)
        self._last: Future[None] | None = None

    def do(self, work: Callable[[], None]) -> None:
        """Wait for the previous task, then start this one; re-raises an exception of the previous task."""
        self.wait()
        self._last = self._thread.submit(work)

    def wait(self) -> None:
        """Wait until the last task is done; re-raises its exception once."""
        last, self._last = self._last, None
        if last is not None:
            last.result()
