"""Errors that are the user's to mend: the command line prints their one line and exits with 2."""

from __future__ import annotations


class CosimError(Exception):
    """Base of all user-facing errors. The message is one line: what is wrong, which value, what to do."""


class FormatError(CosimError):
    """A file does not hold what its format demands."""


class DriveError(CosimError):
    """A folder is not a drive, or lacks a part that was asked for."""
