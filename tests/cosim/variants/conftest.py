"""The paper's eight variants of the small drive."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest

from tests.cosim.conftest import cosim
from tests.sharing import made_once


@pytest.fixture(scope="session")
def source_drive(drive_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Every other frame of the small drive, of both its episodes; its files are links."""

    def thin_out(folder: Path) -> None:
        shutil.copytree(drive_folder, folder / "drive", copy_function=os.link)
        manifest = folder / "drive" / "manifest.jsonl"
        entries = [json.loads(line) for line in manifest.read_text().splitlines()]
        manifest.unlink()
        left_out = [entry for entry in entries if "name" in entry and int(entry["name"]) % 2]
        for file in (file for entry in left_out for file in entry["files"]):
            (folder / "drive" / file).unlink()
        kept = [entry for entry in entries if entry not in left_out]
        manifest.write_text("".join(json.dumps(entry) + "\n" for entry in kept))

    return made_once(tmp_path_factory, "source_drive", thin_out) / "drive"


@pytest.fixture(scope="session")
def variants_folder(source_drive: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    def make(folder: Path) -> None:
        cosim("variants", source_drive, "--variant", "all", "--out", folder / "eight", "--workers", 2, "--quiet")

    return made_once(tmp_path_factory, "variants", make) / "eight"
