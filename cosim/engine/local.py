"""Engine that runs tasks in processes of this machine."""

from __future__ import annotations

import logging
import os
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from cosim.engine.jobs import Affinity, Job, JobEvent, Skipped, Tell, WorkError, affinity_of, with_next
from cosim.engine.parent import Child
from cosim.engine.retries import Attempt, Retries

PATIENCE_S = 300.0
"""Time without an event after which a process is considered to hang [s]; building a town takes longest."""
_POLL_S = 0.5
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class LocalEngine:
    """Distributes tasks to processes of this machine.

    Attributes:
        workers: maximum number of processes.
        patience_s: time without an event after which a process is stopped [s].
    """

    workers: int = 1
    patience_s: float = PATIENCE_S

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise WorkError(f"workers is {self.workers}; give 1 or more")

    def share_out(
        self, job: Job, tasks: Sequence[Any], on_event: Tell, *, refresh_task: Callable[[Any], Any] = lambda task: task
    ) -> list[Skipped]:
        """Execute all tasks; see `Engine.share_out`."""
        count = min(self.workers, len(tasks))
        pool = _Pool(job, max(1, (os.cpu_count() or 1) // max(count, 1)), on_event, self.patience_s)
        retries = Retries(on_event, refresh_task)
        try:
            pool.run(deque(Attempt(task) for task in tasks), count, retries)
        finally:
            pool.stop()
        return retries.skipped


class _Pool:
    """Worker processes and their current tasks."""

    def __init__(self, job: Job, threads: int, on_event: Tell, patience_s: float) -> None:
        self._job, self._threads, self._on_event, self._patience_s = job, threads, on_event, patience_s
        self._idle: list[Child] = []
        self._busy: dict[Connection, tuple[Child, Attempt]] = {}
        self._affinities: dict[int, Affinity] = {}  # of the last task of each process
        self._expected: dict[int, Attempt] = {}  # probable next task of each process

    def run(self, pending: deque[Attempt], count: int, retries: Retries) -> None:
        while pending or self._busy:
            while pending and len(self._busy) < count:
                self._start_task(pending)
            for failed, reason in self._receive_events():
                retry = retries.next_attempt(failed, reason)
                if retry is not None:
                    pending.appendleft(retry)

    def stop(self) -> None:
        for child, _ in self._busy.values():
            child.kill()
        for child in self._idle:
            child.shut_down()

    def _start_task(self, pending: deque[Attempt]) -> None:
        child = self._idle.pop() if self._idle else Child(self._job, self._threads)
        attempt = self._expected.pop(id(child), None)
        if attempt is None or attempt not in pending:
            attempt = self._choose(self._unexpected(pending) or pending, self._affinities.get(id(child), ()))
        pending.remove(attempt)
        self._affinities[id(child)] = affinity_of(attempt.task)
        self._send_task(child, attempt, self._unexpected(pending))
        self._busy[child.connection] = (child, attempt)

    def _send_task(self, child: Child, attempt: Attempt, others: Sequence[Attempt]) -> None:
        """Send a task together with the one that the process probably gets next."""
        if others:
            following = self._expected[id(child)] = self._choose(others, affinity_of(attempt.task))
            child.send_task(with_next(attempt.task, following.task))
        else:
            child.send_task(attempt.task)

    def _unexpected(self, pending: Sequence[Attempt]) -> list[Attempt]:
        """The tasks that are not expected to be the next of another process."""
        expected = list(self._expected.values())
        return [attempt for attempt in pending if attempt not in expected]

    def _choose(self, attempts: Sequence[Attempt], last: Affinity) -> Attempt:
        running = [affinity_of(attempt.task) for _, attempt in self._busy.values()]
        return attempts[_choose_task([affinity_of(attempt.task) for attempt in attempts], last, running)]

    def _receive_events(self) -> list[tuple[Attempt, str]]:
        """Wait briefly for events and forward them; returns the failed attempts with their reasons."""
        failures = []
        for connection in wait(list(self._busy), timeout=_POLL_S):
            assert isinstance(connection, Connection)
            child, attempt = self._busy[connection]
            reason = self._handle(child, child.receive())
            if reason is not None:
                failures.append((attempt, reason))
        for child, attempt in list(self._busy.values()):
            if child.is_hanging(self._patience_s):
                self._remove(child)
                failures.append((attempt, f"its process did not report for {self._patience_s:g} s"))
        return failures

    def _handle(self, child: Child, event: JobEvent | None) -> str | None:
        """Handle an event; returns the reason if the task failed."""
        if event is None:
            reason = child.exit_reason()
            self._remove(child)
            return reason
        if event.kind == "refused":
            raise WorkError(event.text)
        if event.kind == "failed":
            _log.warning("a worker failed:\n%s", event.text)
            self._remove(child)
            return event.text.strip().splitlines()[-1]
        if event.kind == "task":
            del self._busy[child.connection]
            self._idle.append(child)
        self._on_event(event)
        return None

    def _remove(self, child: Child) -> None:
        child.kill()
        self._affinities.pop(id(child), None)
        self._expected.pop(id(child), None)
        del self._busy[child.connection]
        child.connection.close()


def _choose_task(affinities: Sequence[Affinity], last: Affinity, running: Sequence[Affinity]) -> int:
    """Index of the affinity with the longest common prefix with `last`; ties: the shortest with those of `running`."""
    scores = [
        (_prefix_length(affinity, last), -max((_prefix_length(affinity, other) for other in running), default=0))
        for affinity in affinities
    ]
    return scores.index(max(scores))


def _prefix_length(first: Affinity, second: Affinity) -> int:
    """Length of the longest common prefix."""
    return next(
        (i for i, (a, b) in enumerate(zip(first, second, strict=False)) if a != b), min(len(first), len(second))
    )
