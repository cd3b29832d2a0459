"""What there is to do, and what is told about it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from cosim.errors import CosimError


class WorkError(CosimError):
    """Work could not go on."""


@dataclass(frozen=True)
class Event:
    """What a worker tells.

    Attributes:
        kind: `opened` (the job is), `ready` (to record), `alive` (at work, with nothing to show yet), `frame` (one is
            taken), `task` (one is complete), `again`
            (one failed and is tried once more), `skipped` (one failed again), `refused` (the user's mistake, in
            `text`) or `failed` (ours: `text` is a traceback).
        text: frame name or message.
        peak_bytes: most memory that the worker has held so far, told with `task`.
    """

    kind: Literal["opened", "ready", "alive", "frame", "task", "again", "skipped", "refused", "failed"]
    text: str = ""
    peak_bytes: int = 0


Place = tuple[Any, ...]
"""What a process keeps from one task to the next, the dearest first: a task's `place`, if it has one."""

Tell = Callable[[Event], None]
Do = Callable[[Any, Tell], None]
"""Does one task and tells of its frames."""


class Job(Protocol):
    """Work of one kind; pickled, so that processes elsewhere can do it."""

    def open(self, threads: int) -> AbstractContextManager[Do]:
        """Build what all tasks need, once a process; what it gives is called a task at a time."""
        ...


@dataclass(frozen=True)
class Skipped:
    """A task that was tried twice in vain.

    Attributes:
        task: what was to be done.
        reason: what became of the second attempt.
    """

    task: Any
    reason: str


class Engine(Protocol):
    """Has tasks done by processes."""

    def share_out(
        self, job: Job, tasks: Sequence[Any], on_event: Tell, *, renewed: Callable[[Any], Any] = lambda task: task
    ) -> list[Skipped]:
        """Have all tasks done.

        A process that dies, hangs or meets an error is replaced, and its task is given once more.

        Args:
            job: what the processes open.
            tasks: what there is to do; of those with a `place` a process gets such as it has been to, where it can.
            on_event: told of every event.
            renewed: makes a task anew before it is given a second time.

        Returns:
            The tasks that failed twice.

        Raises:
            WorkError: a worker met a user's mistake.
        """
        ...
