"""A small simulated drive whose twin the tests of hidden physics share."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.sharing import made_once

_SETTINGS = "town: town01\nseed: 4\nframes: 12\nwarm_up_s: 45\nimages: []\nstore_hits: false\n"


@pytest.fixture(scope="session")
def base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve frames of a bare hdl64e."""

    def make(folder: Path) -> None:
        (folder / "run.yaml").write_text(_SETTINGS)
        command = [sys.executable, "-c", "import sys; from cosim.cli import main; sys.exit(main())", "run"]
        subprocess.run([*command, folder / "run.yaml", "--out", folder / "base", "--quiet"], check=True, timeout=300)

    return made_once(tmp_path_factory, "hidden", make) / "base"
