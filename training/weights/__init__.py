"""Weights that come with the package, and how they are put there."""

from __future__ import annotations

from pathlib import Path

_DEFAULT = "pillars_small.pt"


def shipped() -> Path:
    """The checkpoint of the detector that comes along: `pillars_small`, trained on simulated frames alone."""
    return Path(__file__).with_name(_DEFAULT)
