"""Processes of this machine."""

from __future__ import annotations

import logging
import os
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from cosim.engine.jobs import Event, Job, Place, Skipped, Tell, WorkError
from cosim.engine.parent import Child
from cosim.engine.retries import Attempt, Retries

PATIENCE_S = 300.0
"""A process that tells nothing for so long hangs [s]: an episode's longest silence is its town's building."""
_POLL_S = 0.5
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
        foremen = _Foremen(job, max(1, (os.cpu_count() or 1) // max(count, 1)), on_event, self.patience_s)
        retries = Retries(on_event, renewed)
        try:
            foremen.oversee(deque(Attempt(task) for task in tasks), count, retries)
        finally:
            foremen.end_all()
        return retries.skipped


class _Foremen:
    """Processes at work, and what each is doing."""

    def __init__(self, job: Job, threads: int, on_event: Tell, patience_s: float) -> None:
        self._job, self._threads, self._on_event, self._patience_s = job, threads, on_event, patience_s
        self._idle: list[Child] = []
        self._busy: dict[Connection, tuple[Child, Attempt]] = {}
        self._been: dict[int, Place] = {}  # where each process was last

    def oversee(self, pending: deque[Attempt], count: int, retries: Retries) -> None:
        while pending or self._busy:
            while pending and len(self._busy) < count:
                self._give(pending)
            for failed, reason in self._hear():
                again = retries.after(failed, reason)
                if again is not None:
                    pending.appendleft(again)

    def end_all(self) -> None:
        for child, _ in self._busy.values():
            child.kill()
        for child in self._idle:
            child.dismiss()

    def _give(self, pending: deque[Attempt]) -> None:
        child = self._idle.pop() if self._idle else Child(self._job, self._threads)
        places = [_place(attempt) for attempt in pending]
        chosen = _most_at_home(places, self._been.get(id(child), ()), self._away())
        attempt = pending[chosen]
        del pending[chosen]
        self._been[id(child)] = _place(attempt)
        child.give(attempt.task)
        self._busy[child.connection] = (child, attempt)

    def _away(self) -> list[Place]:
        """Where those are who are at work."""
        return [_place(attempt) for _, attempt in self._busy.values()]

    def _hear(self) -> list[tuple[Attempt, str]]:
        """Pass on what is told meanwhile; gives the attempts that failed, with the reason."""
        failures = []
        for connection in wait(list(self._busy), timeout=_POLL_S):
            assert isinstance(connection, Connection)
            child, attempt = self._busy[connection]
            reason = self._follow(child, child.hear())
            if reason is not None:
                failures.append((attempt, reason))
        for child, attempt in list(self._busy.values()):
            if child.hangs(self._patience_s):
                self._lose(child)
                failures.append((attempt, f"its process told nothing for {self._patience_s:g} s"))
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
        self._been.pop(id(child), None)
        del self._busy[child.connection]
        child.connection.close()


def _place(attempt: Attempt) -> Place:
    return getattr(attempt.task, "place", ())


def _most_at_home(places: Sequence[Place], been: Place, taken: Sequence[Place]) -> int:
    """Row of the place that has most in common with where one has been, and of those least with where others are."""
    scores = [(_common(place, been), -max((_common(place, other) for other in taken), default=0)) for place in places]
    return scores.index(max(scores))


def _common(one: Place, other: Place) -> int:
    """How many of the first parts of two places are equal."""
    return next((i for i, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), min(len(one), len(other)))
