"""A small drive that the tests of the main job share."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

CONFIG = "town: town01\nseed: 3\nframes: 8\nframes_per_episode: 4\ncollection: {every_s: 2.0}\nwarm_up_s: 45\n"


def cosim(*arguments: object, check: bool = True) -> subprocess.CompletedProcess[str]:
    """Run the command line in a process of its own, as a user does."""
    command = [sys.executable, "-c", "import sys; from cosim.cli import main; sys.exit(main())"]
    result = subprocess.run([*command, *map(str, arguments)], capture_output=True, text=True, timeout=600)
    if check:
        assert result.returncode == 0, result.stderr
    return result


@pytest.fixture(scope="session")
def run_config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A configuration of two short episodes."""
    path = tmp_path_factory.mktemp("config") / "run.yaml"
    path.write_text(CONFIG)
    return path


@pytest.fixture(scope="session")
def drive_folder(run_config: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The drive it gives."""
    folder = tmp_path_factory.mktemp("drives") / "whole"
    cosim("run", run_config, "--out", folder, "--workers", 2, "--quiet")
    return folder
