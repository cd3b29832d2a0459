"""A twin that several files of tests use."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim.cli import main
from sensors.pattern import load_pattern
from tests.cosim.recordings.simulated import path, record
from tests.sharing import made_once


@pytest.fixture(scope="module")
def twin(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A twin of fourteen scans; `scans/`, `twin/`, `page/` and `twin.json` in one folder."""
    pytest.importorskip("kiss_icp")

    def make(folder: Path) -> None:
        record(folder / "scans", path(), load_pattern("vlp32c"))
        out = ["--out", str(folder / "twin"), "--json", str(folder / "twin.json"), "--page", str(folder / "page")]
        assert main(["twin", str(folder / "scans"), *out, "--quiet"]) == 0

    return made_once(tmp_path_factory, "recording_twin", make)
