"""The paper's eight variants of two frames."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cosim.conftest import cosim
from tests.sharing import made_once


@pytest.fixture(scope="session")
def variants_folder(source_drive: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    def make(folder: Path) -> None:
        cosim("variants", source_drive, "--variant", "all", "--out", folder / "eight", "--workers", 2, "--quiet")

    return made_once(tmp_path_factory, "variants", make) / "eight"
