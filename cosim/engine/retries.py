"""A task that fails is tried once more, then left out."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from cosim.engine.jobs import Event, Skipped, Tell

_MOST = 2
_log = logging.getLogger(__name__)


class Attempt(NamedTuple):
    """A task, and how often it has been given."""

    task: Any
    number: int = 1


@dataclass
class Retries:
    """Decides what becomes of tasks that fail.

    Attributes:
        on_event: told of every task that is tried again or left out.
        renewed: makes a task anew before it is given a second time.
        skipped: tasks that were left out.
    """

    on_event: Tell
    renewed: Callable[[Any], Any]
    skipped: list[Skipped] = field(default_factory=list)

    def after(self, failed: Attempt, reason: str) -> Attempt | None:
        """What to give next in place of an attempt that failed, if anything."""
        if failed.number < _MOST:
            _log.warning("a task failed and is tried once more: %s", reason)
            self.on_event(Event("again", reason))
            return Attempt(self.renewed(failed.task), failed.number + 1)
        self.on_event(Event("skipped", reason))
        self.skipped.append(Skipped(failed.task, reason))
        return None
