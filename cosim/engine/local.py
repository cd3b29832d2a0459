"""Processes of this machine."""

from __future__ import annotations

import logging
import os
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from cosim.engine.jobs import Event, Job, Skipped, Tell, WorkError
from cosim.engine.parent import Child

PATIENCE_S = 300.0
"""A process that tells nothing for so long hangs [s]: an episode's longest silence is its town's building."""
_POLL_S = 0.5
ATTEMPTS = 2
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class LocalEngine:
    """Shares tasks among processes of this machine.

    Attributes:
        workers: most processes.
        patience_s: a process that tells nothing for so long is ended [s].
    """

    workers: int = 1
    patience_s: float = PATIENCE_S

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise WorkError(f"workers is {self.workers}; give 1 or more")

    def share_out(
        self, job: Job, tasks: Sequence[Any], on_event: Tell, *, renewed: Callable[[Any], Any] = lambda task: task
    ) -> list[Skipped]:
        """Have all tasks done; see `Engine`."""
        count = min(self.workers, len(tasks))
        foremen = _Foremen(job, max(1, (os.cpu_count() or 1) // max(count, 1)), on_event, self.patience_s, renewed)
        try:
            return foremen.oversee(deque((task, 1) for task in tasks), count)
        finally:
            foremen.end_all()


class _Foremen:
    """Processes at work, and what each is doing."""

    def __init__(
        self, job: Job, threads: int, on_event: Tell, patience_s: float, renewed: Callable[[Any], Any]
    ) -> None:
        self._job, self._threads, self._on_event, self._patience_s = job, threads, on_event, patience_s
        self._renewed = renewed
        self._idle: list[Child] = []
        self._busy: dict[Connection, tuple[Child, Any, int]] = {}

    def oversee(self, pending: deque[tuple[Any, int]], count: int) -> list[Skipped]:
        skipped: list[Skipped] = []
        while pending or self._busy:
            while pending and len(self._busy) < count:
                self._give(*pending.popleft())
            for failed, attempt, reason in self._hear():
                if attempt < ATTEMPTS:
                    _log.warning("a task failed and is tried once more: %s", reason)
                    self._on_event(Event("again", reason))
                    pending.appendleft((self._renewed(failed), attempt + 1))
                else:
                    self._on_event(Event("skipped", reason))
                    skipped.append(Skipped(failed, reason))
        return skipped

    def end_all(self) -> None:
        for child, *_ in self._busy.values():
            child.kill()
        for child in self._idle:
            child.dismiss()

    def _give(self, task: Any, attempt: int) -> None:
        child = self._idle.pop() if self._idle else Child(self._job, self._threads)
        child.give(task)
        self._busy[child.connection] = (child, task, attempt)

    def _hear(self) -> list[tuple[Any, int, str]]:
        """Pass on what is told meanwhile; gives the tasks that failed, with their attempt and the reason."""
        failures = []
        for connection in wait(list(self._busy), timeout=_POLL_S):
            assert isinstance(connection, Connection)
            child, task, attempt = self._busy[connection]
            reason = self._follow(child, child.hear())
            if reason is not None:
                failures.append((task, attempt, reason))
        for child, task, attempt in list(self._busy.values()):
            if child.hangs(self._patience_s):
                self._lose(child)
                failures.append((task, attempt, f"its process told nothing for {self._patience_s:g} s"))
        return failures

    def _follow(self, child: Child, event: Event | None) -> str | None:
        """Act on an event; says why its task failed, if so."""
        if event is None:
            reason = child.obituary()
            self._lose(child)
            return reason
        if event.kind == "refused":
            raise WorkError(event.text)
        if event.kind == "failed":
            _log.warning("a worker failed:\n%s", event.text)
            self._lose(child)
            return event.text.strip().splitlines()[-1]
        if event.kind == "task":
            del self._busy[child.connection]
            self._idle.append(child)
        self._on_event(event)
        return None

    def _lose(self, child: Child) -> None:
        child.kill()
        del self._busy[child.connection]
        child.connection.close()
