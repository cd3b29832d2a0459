"""Simulated drives whose twins are measured with hidden physics, one per town, beam pattern and traffic seed."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import yaml

FOLDER = Path("out/hidden")
TOWNS = tuple(f"town{number:02d}" for number in range(1, 10))
PATTERNS = ("hdl64e", "hdl32e", "vlp32c")
FRAMES = 20
_SETTINGS = {"frames": FRAMES, "population": {"parked_factor": [1.0, 1.2], "driving_factor": [1.0, 1.2]}}


@dataclass(frozen=True)
class Base:
    """A simulated drive.

    Attributes:
        town: built-in town.
        pattern: named beam pattern.
        seed: of the traffic.
    """

    town: str
    pattern: str
    seed: int

    @property
    def name(self) -> str:
        """Name of the drive's folder."""
        return f"{self.town}_{self.pattern}_s{self.seed}"


def base_drive(base: Base, folder: Path = FOLDER) -> Path:
    """Return the folder of a base drive; record it if it does not exist: 20 frames of a moving car in dense traffic."""
    drive = folder / "base" / base.name
    if not (drive / "drive.yaml").exists():
        drive.parent.mkdir(parents=True, exist_ok=True)
        settings = folder / "base.yaml"
        settings.write_text(yaml.safe_dump(_SETTINGS))
        command = [sys.executable, "-c", "import sys; from cosim.cli import main; sys.exit(main())", "run"]
        options = ["--town", base.town, "--seed", str(base.seed), "--sensor", base.pattern, "--workers", "1", "--quiet"]
        one_thread = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        subprocess.run([*command, str(settings), *options, "--out", str(drive)], check=True, env=one_thread)
    return drive
