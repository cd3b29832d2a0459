"""Retry a failed task once, then skip it."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from cosim.engine.jobs import JobEvent, Skipped, Tell

_MAX_ATTEMPTS = 2
_log = logging.getLogger(__name__)


class Attempt(NamedTuple):
    """A task and the number of this attempt, from 1."""

    task: Any
    number: int = 1


@dataclass
class Retries:
    """Decides whether a failed task is retried.

    Attributes:
        on_event: called with an event for every task that is retried or skipped.
        refresh_task: updates a task before it is retried.
        skipped: skipped tasks.
    """

    on_event: Tell
    refresh_task: Callable[[Any], Any]
    skipped: list[Skipped] = field(default_factory=list)

    def next_attempt(self, failed: Attempt, reason: str) -> Attempt | None:
        """Next attempt for a failed task, or None if the task is skipped."""
        if failed.number < _MAX_ATTEMPTS:
            _log.warning("a task failed and is retried: %s", reason)
            self.on_event(JobEvent("again", reason))
            return Attempt(self.refresh_task(failed.task), failed.number + 1)
        self.on_event(JobEvent("skipped", reason))
        self.skipped.append(Skipped(failed.task, reason))
        return None
