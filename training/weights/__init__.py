"""Bundled weights."""

from __future__ import annotations

from pathlib import Path

_DEFAULT = "pillars_small.pt"


def shipped() -> Path:
    """Path of the bundled checkpoint: `pillars_small`, trained on simulated frames only."""
    return Path(__file__).with_name(_DEFAULT)
