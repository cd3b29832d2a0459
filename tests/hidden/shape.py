"""How much of an unseen effect's shape the improved sensor has, measured by running it on hits of the same world."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from tests.hidden.drive import Hidden
from tests.hidden.floor import read_measured
from tests.hidden.head import Beams, nominal_beams
from tests.hidden.physics import NOISE, Truth, measure
from tests.hidden.process import Version
from tests.hidden.score import r_squared
from tests.hidden.twin_files import read_frames, read_pattern
from tests.hidden.twin_tracing import Twin
from tests.hidden.unseen.registry import KINDS

_FRAMES = 4
_LIMIT_S = 200.0
_SAME_SURFACE_M = 0.3  # a larger change of range is another surface, not a shape
_COLUMNS = {"range": "range_m", "signal": "intensity", "aim": "range_m"}


def measured_shape(hidden: Hidden, base: Path, improved: Path, work: Path, version: Version) -> dict[str, Any]:
    """`shape_r2`, the share of the variance of the true shape that the improved sensor explains; empty without one.

    Args:
        hidden: what was hidden.
        base: the simulated drive, whose stored hits are replayed with what the diagnosis added, and without noise.
        improved: the improved sensor, with its plug-ins next to it.
        work: folder for the replayed drive.
        version: the code that diagnosed.

    Where the replay fails, `shape_trouble` says why. With several unseen effects the least counts. Losses, noise and
    random errors have no shape to subtract.
    """
    shapes = {name: p for name, p in hidden.unseen.items() if has_shape(name, p)}
    if not shapes or len(shapes) < len(hidden.unseen) or hidden.effects:
        return {}
    document = yaml.safe_load(improved.read_text())
    known = {*hidden.believed, *NOISE}
    added = [entry for entry in document["effects"] if entry["effect"] not in known]
    if not added:
        return {"shape_r2": 0.0}
    (improved.parent / "shape.yaml").write_text(yaml.safe_dump({**document, "effects": added}))
    out, variant = work / "shape", improved.parent / "shape.yaml"
    ended = version.run(work, _LIMIT_S, "variants", base.resolve(), "--variant", variant, "--out", out, "--quiet")
    if ended.trouble:
        return {"shape_trouble": ended.trouble}
    return {"shape_r2": min(_explained(name, values, base, out / "shape") for name, values in shapes.items())}


def has_shape(name: str, parameters: Mapping[str, Any]) -> bool:
    """Whether an effect moves ranges or intensities by a function of what is known of a beam."""
    return KINDS[name].stage(parameters) in _COLUMNS and not KINDS[name].is_random(parameters)


def _explained(name: str, parameters: Mapping[str, Any], base: Path, replayed: Path) -> float:
    twin, beams, frames = Twin(base / "twin"), nominal_beams(read_pattern(base)), read_frames(base)
    column = _COLUMNS[KINDS[name].stage(parameters)]
    truth = Truth(unseen={name: parameters})
    true, found = [], []
    for row in np.linspace(0, len(frames) - 1, _FRAMES).round().astype(int):
        frame, elapsed = frames[row], frames[row]["time_s"] - frames[0]["time_s"]
        bare, odd = (_measured(one, twin, frame, beams, elapsed) for one in (replace(truth, unseen={}), truth))
        plain, shaped = (read_measured(drive, frame["frame"], beams) for drive in (base, replayed))
        both = bare.found & odd.found & plain.found & shaped.found
        changes = [(getattr(b, column) - getattr(a, column))[both] for a, b in ((bare, odd), (plain, shaped))]
        same = np.abs(changes).max(0) < (_SAME_SURFACE_M if column == "range_m" else np.inf)
        true.append(changes[0][same])
        found.append(changes[1][same])
    return r_squared(np.concatenate(true), np.concatenate(found))


def _measured(truth: Truth, twin: Twin, frame: dict, beams: Beams, elapsed_s: float) -> Any:
    return measure(truth, twin, frame, beams, np.random.default_rng(0), elapsed_s)
