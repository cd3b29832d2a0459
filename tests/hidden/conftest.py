"""A small simulated drive whose twin the tests of hidden physics share."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def base(drive_folder: Path) -> Path:
    """Eight frames of a bare hdl64e."""
    return drive_folder
