"""What a diagnosis got right."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tests.hidden.cases import Case
from tests.hidden.unnamed import UNNAMED, accepted

_TOP = 5


def score(case: Case, result: Mapping[str, Any], floor: float) -> dict[str, Any]:
    """One row of the benchmark.

    Args:
        case: what was hidden.
        result: of `judge`.
        floor: noise floor of the held-out drive.
    """
    row: dict[str, Any] = {"trouble": result["trouble"], "floor": floor}
    diagnosis = result.get("diagnosis")
    if diagnosis is None:
        return row | {"verdict": "failed"}
    hidden = set(case.hidden.effects)
    effects = diagnosis["effects"]
    added = [entry["effect"] for entry in effects]
    named = {*added, *(name for entry in effects for name in entry.get("also_possible", []))}
    row |= {
        "verdict": diagnosis["verdict"],
        "added": added,
        "ranking": [
            f"{r['effect']} {r['delta_bic']:.0f} p={r['p_value']:.3g}" for r in diagnosis.get("ranking", [])[:_TOP]
        ],
        "first_right": bool(added) and added[0] in hidden,
        "in_set": hidden <= named,
        "exact_set": set(added) == hidden,
        "false_additions": len(set(added) - hidden),
        "unknown": diagnosis.get("unknown"),
        "wall_s": result["wall_s"],
        "cpu_s": result["cpu_s"],
        "rss_gib": result["rss_gib"],
    }
    row["alarm"] = bool(added) or diagnosis.get("unknown") is not None
    row |= _parameters(case, effects)
    if "held_out_after" in result:
        before, after = result["held_out_before"]["error"], result["held_out_after"]["error"]
        row |= {"held_out_before": before, "held_out_after": after, "held_out_ratio": after / floor}
        row["explained"] = (before - after) / (before - floor) if before > floor else None
    for name in case.hidden.unnamed:
        row |= _unnamed(name, diagnosis.get("unknown"))
    return row


def _parameters(case: Case, effects: list[dict]) -> dict[str, Any]:
    """Relative errors of parameters by name, and which share of the 95 % intervals hold the truth."""
    errors, held, asked = {}, 0, 0
    for entry in effects:
        truth = case.hidden.effects.get(entry["effect"])
        if truth is None:
            continue
        for key, true in truth.items():
            told = entry["params"].get(key)
            if isinstance(true, str) or told is None:
                continue
            errors[f"{entry['effect']}.{key}"] = relative_error(key, true, told)
            interval = entry.get("ci95", {}).get(key)
            if interval is not None and np.ndim(interval) == np.ndim(true) + 1:
                bounds = np.asarray(interval, float).reshape(-1, 2)
                inside = (bounds[:, 0] <= np.ravel(true)) & (np.ravel(true) <= bounds[:, 1])
                held, asked = held + int(inside.sum()), asked + len(inside)
    return {"parameter_errors": errors, "intervals_held": held, "intervals": asked}


def relative_error(key: str, true, told) -> float:
    """Of a number to itself, of an angle of phase to a turn, of a list in root mean square."""
    true, told = np.asarray(true, float), np.asarray(told, float)
    if true.shape != told.shape:
        return float("inf")
    if key in ("phase_deg", "azimuth_deg"):
        return float(abs((told - true + 180) % 360 - 180) / 360)
    scale = np.sqrt(np.mean(true**2))
    return float(np.sqrt(np.mean((told - true) ** 2)) / scale) if scale else float("nan")


def _unnamed(name: str, unknown: Mapping[str, Any] | None) -> dict[str, Any]:
    if unknown is None:
        return {"flagged": False, "right_channel": False, "right_covariate": False, "claimed_r2": None}
    covariates = unknown.get("covariates") or [None]
    return {
        "flagged": True,
        "right_channel": unknown.get("channel") == UNNAMED[name].channel,
        "right_covariate": covariates[0] in accepted(name),
        "claimed_r2": unknown.get("r2"),
    }
