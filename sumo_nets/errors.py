"""The one exception of this package."""

from __future__ import annotations


class TownError(ValueError):
    """A town cannot be built or read; the message is one line that says what to do."""
