"""What the tests of training share."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.training.tiny_drive import write_drive


@pytest.fixture(scope="session")
def tiny_drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive of four small frames with two cars each."""
    return write_drive(tmp_path_factory.mktemp("tiny") / "drive")
