"""Makes, diagnoses and scores one case; everything it needs to know of the truth stays on this side."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from tests.hidden.base_drives import base_drive
from tests.hidden.cases import Case
from tests.hidden.drive import Made, make_drive
from tests.hidden.floor import noise_floor
from tests.hidden.process import Version
from tests.hidden.score import score
from tests.hidden.shape import shape_found

_HELD_OUT_FRAMES = 5
_FLOOR_FRAMES = 4  # of the diagnosed drive, evenly spread
_COMPARE_LIMIT_S = 300.0


def run_case(case: Case, folder: Path, limit_s: float, version: Version, keep: bool = False) -> dict[str, Any]:
    """The score of a case.

    Args:
        case: what to hide.
        folder: of all hidden-effect drives.
        limit_s: CPU seconds that the diagnosis may take.
        version: the code that diagnoses.
        keep: leave the drives.
    """
    work = (folder / "work" / f"{case.name}_{os.getpid()}").resolve()
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    try:
        base = base_drive(case.base, folder)
        made = make_drive(base, work / "drive", case.hidden, folder / "cache")
        result = _diagnosed(work, made, limit_s, version)
        if "diagnosis" in result:
            result |= _floors(case, base, made) | _held_out(case, work, folder, version)
            result |= shape_found(case, base, work / "diagnosis" / "sensor.yaml", work, version)
        return {"case": case.name, "group": case.group, "level": case.level, **score(case, result), "result": result}
    finally:
        if not keep:
            shutil.rmtree(work, ignore_errors=True)


def _diagnosed(work: Path, made: Made, limit_s: float, version: Version) -> dict[str, Any]:
    told, out = work / "diagnosis.json", work / "diagnosis"
    ended = version.run(
        work, limit_s, "diagnose", made.drive, "--sensor", made.sensor, "--out", out, "--json", told, "--quiet"
    )
    result: dict[str, Any] = asdict(ended)
    if not ended.trouble:
        result["diagnosis"] = json.loads(told.read_text())
    return result


def _floors(case: Case, base: Path, made: Made) -> dict[str, Any]:
    """The error of the true sensor in the true world, on the data that were diagnosed."""
    if not case.hidden.rays:
        return {}
    count = len(list((made.drive / "velodyne").glob("*.bin")))
    rows = sorted({round((row + 0.5) * count / _FLOOR_FRAMES - 0.5) for row in range(_FLOOR_FRAMES)})
    floor = noise_floor(case.hidden.truth, made.drive, rows, seed=case.hidden.seed, world=base)
    return {"floor": floor.error, "floor_channels": floor.channels}


def _held_out(case: Case, work: Path, folder: Path, version: Version) -> dict[str, Any]:
    """Errors before and after, and the floor, of a drive that the diagnosis never saw, with its exact twin."""
    hidden = replace(case.hidden, frames=_HELD_OUT_FRAMES, seed=case.hidden.seed + 1, nuisances=(), rays=True)
    other = make_drive(base_drive(case.held_out, folder), work / "held_out", hidden, folder / "cache")
    floor = noise_floor(hidden.truth, other.drive, range(0, _HELD_OUT_FRAMES, 2), seed=hidden.seed)
    found: dict[str, Any] = {"held_out_floor": floor.error}
    for key, sensor in (("before", other.sensor), ("after", work / "diagnosis" / "sensor.yaml")):
        told = work / f"{key}.json"
        page = work / f"{key}_page"
        ended = version.run(
            work, _COMPARE_LIMIT_S, "compare", other.drive, "--sensor", sensor, "--out", page, "--json", told, "--quiet"
        )
        if ended.trouble:
            found["held_out_trouble"] = ended.trouble
        else:
            found[f"held_out_{key}"] = json.loads(told.read_text())["error"]
    return found
