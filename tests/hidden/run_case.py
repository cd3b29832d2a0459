"""Makes a case, runs `cosim compare` and `cosim diagnose` on it, and scores the answers."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tests.hidden.cases import Case
from tests.hidden.drive import Hidden, Made, correct_findings, make_drive
from tests.hidden.floor import noise_floor
from tests.hidden.process import Version
from tests.hidden.score import score
from tests.hidden.shape import measured_shape

_FLOOR_FRAMES = 4  # of the diagnosed drive, evenly spread


def run_case(case: Case, folder: Path, limit_s: float, version: Version, keep: bool = False) -> dict[str, Any]:
    """Return the scores of a case and what they are computed from.

    Args:
        case: what to hide.
        folder: of all hidden-effect drives.
        limit_s: CPU seconds that a command may take.
        version: the code that is scored.
        keep: leave the drives.
    """
    work = (folder / "work" / f"{case.name}_{os.getpid()}").resolve()
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    try:
        base, hidden = case.resolve(folder)
        made = make_drive(base, work / "drive", hidden)
        result: dict[str, Any] = _truth(case, base, hidden, made, folder)
        sensor = ("--sensor", made.sensor)
        result["compare"] = _run(version, work, limit_s, "compare", made.drive, *sensor)
        result["diagnose"] = _run(version, work, limit_s, "diagnose", made.drive, *sensor)
        if "json" in result["diagnose"]:
            result |= measured_shape(hidden, base, work / "diagnose" / "sensor.yaml", work, version)
        return {**score(case, result), "result": result}
    finally:
        if not keep:
            shutil.rmtree(work, ignore_errors=True)


def _run(version: Version, work: Path, limit_s: float, command: str, *arguments: str | Path) -> dict[str, Any]:
    """Run a command in a process of its own: its cost, its JSON, or what went wrong."""
    report, out = work / f"{command}.json", work / command
    ended = version.run(work, limit_s, command, *arguments, "--out", out, "--json", report, "--quiet")
    answer: dict[str, Any] = asdict(ended)
    if not ended.trouble:
        answer["json"] = json.loads(report.read_text())
    return answer


def _truth(case: Case, base: Path, hidden: Hidden, made: Made, folder: Path) -> dict[str, Any]:
    """The truth of a case and the error of the true sensor in the true world, kept for other versions of the code."""
    kept = folder / "truths" / f"{case.name}.json"
    if kept.exists():
        return json.loads(kept.read_text())

    count = len(list((made.drive / "velodyne").glob("*.bin")))
    rows = sorted({round((row + 0.5) * count / _FLOOR_FRAMES - 0.5) for row in range(_FLOOR_FRAMES)})
    floor = noise_floor(hidden.truth, made.drive, rows, seed=hidden.seed, world=base)
    truth = {
        "base": base.name,
        "effects": hidden.effects,
        "unseen": hidden.unseen,
        "findings": [finding.to_json() for finding in correct_findings(base, hidden)],
    }
    result = {"truth": truth, "floor": floor.error, "floor_channels": floor.channels}
    kept.parent.mkdir(parents=True, exist_ok=True)
    part = kept.with_suffix(f".{os.getpid()}.part")
    part.write_text(json.dumps(result, indent=1))
    part.replace(kept)
    return json.loads(kept.read_text())
