"""Makes, diagnoses and scores one case; everything it needs to know of the truth stays on this side."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

from tests.hidden.base_drives import base_drive
from tests.hidden.cases import Case
from tests.hidden.drive import make_drive
from tests.hidden.floor import noise_floor
from tests.hidden.score import score

_HELD_OUT_FRAMES = 5
_ROOT = Path(__file__).resolve().parents[2]


def run_case(case: Case, folder: Path, limit_s: float, keep: bool = False, broken_gate: bool = False) -> dict:
    """The score of a case.

    Args:
        case: what to hide.
        folder: of all hidden-effect drives.
        limit_s: the diagnosis may take no longer.
        keep: leave the drives.
        broken_gate: diagnose with a gate that lets everything through.
    """
    work = (folder / "work" / f"{case.name}_{os.getpid()}").resolve()
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    try:
        made = make_drive(base_drive(case.base, folder), work / "drive", case.hidden, folder / "cache")
        hidden = replace(case.hidden, frames=_HELD_OUT_FRAMES, seed=case.hidden.seed + 1, nuisances=(), rays=True)
        other = make_drive(base_drive(case.held_out, folder), work / "held_out", hidden, folder / "cache")
        floor = noise_floor(hidden.truth, other.drive, range(0, _HELD_OUT_FRAMES, 2), seed=hidden.seed)
        result = _judged(work, made.drive, made.sensor, other.drive, limit_s, broken_gate)
        return {"case": case.name, "group": case.group, **score(case, result, floor.error), "result": result}
    finally:
        if not keep:
            shutil.rmtree(work, ignore_errors=True)


def _judged(work: Path, drive: Path, sensor: Path, held_out: Path, limit_s: float, broken_gate: bool) -> dict:
    paths = {"drive": drive, "sensor": sensor, "held_out": held_out, "out": work / "diagnosis"}
    task = {key: str(path) for key, path in paths.items()}
    task |= {"result": str(work / "result.json"), "broken_gate": broken_gate}
    (work / "task.json").write_text(json.dumps(task))
    environment = {**os.environ, "PYTHONPATH": str(_ROOT), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "tests.hidden.judge", str(work / "task.json")]
    started = time.monotonic()
    trouble = ""
    try:
        ended = subprocess.run(command, cwd=work, env=environment, timeout=limit_s, capture_output=True, text=True)
        if ended.returncode:
            trouble = ended.stderr.strip()[-1500:] or f"ended with {ended.returncode}"
    except subprocess.TimeoutExpired:
        trouble = f"took longer than {limit_s:.0f} s"
    found = json.loads((work / "result.json").read_text()) if (work / "result.json").exists() else {}
    return {"trouble": trouble, "total_s": time.monotonic() - started, **found}
