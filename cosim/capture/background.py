"""Work that goes on while the next is prepared."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor


class BackgroundWriter:
    """Does one thing at a time in a thread of its own, in the order given."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1)
        self._last: Future[None] | None = None

    def do(self, work: Callable[[], None]) -> None:
        """Begin some work once what came before is done; raises what that raised."""
        self.settle()
        self._last = self._thread.submit(work)

    def settle(self) -> None:
        """Wait until all is done; raises what the last work raised, once."""
        last, self._last = self._last, None
        if last is not None:
            last.result()
