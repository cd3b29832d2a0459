"""The paper's eight variants of the small drive."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cosim.conftest import cosim


@pytest.fixture(scope="session")
def variants_folder(drive_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("variants") / "eight"
    cosim("variants", drive_folder, "--variant", "all", "--out", folder, "--workers", 2, "--quiet")
    return folder
