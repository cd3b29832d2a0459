"""The simulated drives whose twins hidden physics is measured in."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import yaml

FOLDER = Path("out/hidden")
TOWNS = ("town01", "town04", "town07")
SEEDS = (1, 2)
FRAMES = 20
NAMES = tuple(f"{town}_s{seed}" for seed in SEEDS for town in TOWNS)
_SETTINGS = {"frames": FRAMES, "population": {"parked_factor": [1.0, 1.2], "driving_factor": [1.0, 1.2]}}


def base_drive(name: str, folder: Path = FOLDER) -> Path:
    """The drive of that name, simulated now if it is not there: 20 frames of a moving car among many others."""
    town, seed = name.split("_s")
    drive = folder / "base" / name
    if not (drive / "drive.yaml").exists():
        drive.parent.mkdir(parents=True, exist_ok=True)
        settings = folder / "base.yaml"
        settings.write_text(yaml.safe_dump(_SETTINGS))
        command = [sys.executable, "-c", "import sys; from cosim.cli import main; sys.exit(main())", "run"]
        options = ["--town", town, "--seed", seed, "--sensor", "hdl64e", "--workers", "1", "--quiet"]
        one_thread = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        subprocess.run([*command, str(settings), *options, "--out", str(drive)], check=True, env=one_thread)
    return drive
