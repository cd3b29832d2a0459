"""How much of an unknown effect's shape the improved sensor has, measured by running it on hits of the same world."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from tests.hidden.cases import Case
from tests.hidden.floor import read_told
from tests.hidden.head import Aim, nominal_beams
from tests.hidden.physics import NOISE, Truth, measure, told
from tests.hidden.process import Version
from tests.hidden.twin_files import read_frames, read_pattern
from tests.hidden.twin_tracing import Twin
from tests.hidden.unknowns import KINDS

_FRAMES = 4
_LIMIT_S = 200.0


def shape_found(case: Case, base: Path, improved: Path, work: Path, version: Version) -> dict[str, Any]:
    """`shape_r2`, the share of the variance of the true shape that the improved sensor takes away; nothing without one.

    Args:
        case: what was hidden.
        base: the simulated drive, whose stored hits are replayed with what the diagnosis added, and without noise.
        improved: the improved sensor, with its plug-ins beside it.
        work: folder for the replayed drive.
        version: the code that diagnosed.

    Where the replay fails, `shape_trouble` says why. With several unknown effects the least counts. Losses, noise and
    random depths have no shape to subtract.
    """
    shapes = {name: p for name, p in case.hidden.unnamed.items() if _is_shape(name, p)}
    document = yaml.safe_load(improved.read_text())
    known = {*case.hidden.believed, *NOISE}
    added = [entry for entry in document["effects"] if entry["effect"] not in known]
    if not shapes or not added:
        return {}
    (improved.parent / "shape.yaml").write_text(yaml.safe_dump({**document, "effects": added}))
    out = work / "shape"
    ended = version.run(
        work, _LIMIT_S, "variants", base.resolve(), "--variant", improved.parent / "shape.yaml", "--out", out, "--quiet"
    )
    if ended.trouble:
        return {"shape_trouble": ended.trouble}
    return {"shape_r2": min(_explained(name, values, base, out / "shape") for name, values in shapes.items())}


def _is_shape(name: str, parameters: Mapping[str, Any]) -> bool:
    late = name in KINDS and KINDS[name].late(parameters)
    return told(name, parameters).channels[0] != "drop" and name not in ("noise_shape", "porous") and not late


def _explained(name: str, parameters: Mapping[str, Any], base: Path, replayed: Path) -> float:
    twin, beams, frames = Twin(base / "twin"), nominal_beams(read_pattern(base)), read_frames(base)
    column = "range_m" if told(name, parameters).channels[0] == "range" else "intensity"
    true, found = [], []
    for row in np.linspace(0, len(frames) - 1, _FRAMES).round().astype(int):
        frame, elapsed = frames[row], frames[row]["time_s"] - frames[0]["time_s"]
        aim = Aim.nominal(beams)
        surfaces = twin.cast(frame, *aim.rays(frame), aim.after, beams.range_m)
        truths = (Truth(), Truth(unnamed={name: parameters}))
        bare, odd = (
            measure(truth, twin, frame, beams, np.random.default_rng(0), elapsed, surfaces) for truth in truths
        )
        plain, shaped = (read_told(drive, frame["frame"], beams) for drive in (base, replayed))
        both = bare.found & odd.found & plain.found & shaped.found
        true.append((getattr(odd, column) - getattr(bare, column))[both])
        found.append((getattr(shaped, column) - getattr(plain, column))[both])
    return r_squared(np.concatenate(true), np.concatenate(found))


def r_squared(true: np.ndarray, found: np.ndarray) -> float:
    """1 − squares left / squares about the mean."""
    about = float(((true - true.mean()) ** 2).sum())
    return 1 - float(((true - found) ** 2).sum()) / about if about else 0.0
