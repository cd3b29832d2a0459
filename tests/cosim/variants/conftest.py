"""The paper's eight variants of the small drive."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cosim.conftest import cosim
from tests.sharing import made_once


@pytest.fixture(scope="session")
def variants_folder(drive_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    def make(folder: Path) -> None:
        cosim("variants", drive_folder, "--variant", "all", "--out", folder / "eight", "--workers", 2, "--quiet")

    return made_once(tmp_path_factory, "variants", make) / "eight"
