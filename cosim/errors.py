"""Errors that the user can correct: the command line prints their one-line message and exits with code 2."""

from __future__ import annotations


class CosimError(Exception):
    """Base of all user-facing errors. The message is one line: what is wrong, which value, what to do."""


class FormatError(CosimError):
    """A file does not follow its format."""


class DriveError(CosimError):
    """A folder is not a drive, or a requested part of a drive does not exist."""
