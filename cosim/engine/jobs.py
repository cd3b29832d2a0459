"""Jobs, events and the interface of engines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from cosim.errors import CosimError


class WorkError(CosimError):
    """The work could not be completed."""


@dataclass(frozen=True)
class JobEvent:
    """Event of a worker.

    Attributes:
        kind: `opened` (the job is open), `ready` (ready to record), `alive` (working, no result yet), `frame` (a frame
            is recorded), `task` (a task is complete), `again` (a task failed and is retried), `skipped` (a task failed
            twice), `refused` (an error of the user; `text` is the message) or `failed` (an internal error; `text` is
            the traceback).
        text: frame name, message or traceback.
        peak_bytes: peak memory of the worker so far, with `task` [bytes].
    """

    kind: Literal["opened", "ready", "alive", "frame", "task", "again", "skipped", "refused", "failed"]
    text: str = ""
    peak_bytes: int = 0


Affinity = tuple[Any, ...]
"""State that a process keeps between tasks, the most expensive part first: a task's `affinity`, if it has one."""


def affinity_of(task: Any) -> Affinity:
    """The `affinity` of a task; empty if it has none."""
    return getattr(task, "affinity", ())


def with_next(task: Any, following: Any) -> Any:
    """A task with the knowledge of the one that its process gets next, if it can make use of it (`followed_by`)."""
    return task.followed_by(following) if hasattr(task, "followed_by") else task


Tell = Callable[[JobEvent], None]
Do = Callable[[Any, Tell], None]
"""Executes one task; reports its frames as events."""


class Job(Protocol):
    """Picklable description of the work of a process."""

    def open(self, threads: int) -> AbstractContextManager[Do]:
        """Build the resources that all tasks share, once per process; yields the function that executes one task."""
        ...


@dataclass(frozen=True)
class Skipped:
    """A task that failed twice.

    Attributes:
        task: the task.
        reason: reason of the second failure.
    """

    task: Any
    reason: str


class Engine(Protocol):
    """Executes tasks in worker processes."""

    def share_out(
        self, job: Job, tasks: Sequence[Any], on_event: Tell, *, refresh_task: Callable[[Any], Any] = lambda task: task
    ) -> list[Skipped]:
        """Execute all tasks.

        A process that dies, hangs or raises an error is replaced, and its task is retried once.

        Args:
            job: job that every process opens.
            tasks: tasks to execute; a process preferably gets tasks whose `affinity` equals that of its last task. If
                the next task of the process can be foreseen, a task with the method `followed_by` is replaced by
                `task.followed_by(next)`.
            on_event: called with every event.
            refresh_task: updates a task before it is retried.

        Returns:
            The tasks that failed twice.

        Raises:
            WorkError: a worker reported an error of the user.
        """
        ...
