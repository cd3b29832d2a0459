"""What a diagnosis got right."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tests.hidden.cases import Case
from tests.hidden.truth import Told

_TOP = 5
_BUDGET_OFF = 0.02


def score(case: Case, result: Mapping[str, Any]) -> dict[str, Any]:
    """One row of the benchmark.

    Args:
        case: what was hidden.
        result: what `run_case` gathered: cost, the diagnosis, floors and errors of the held-out drive.
    """
    cost = {key: result.get(key) for key in ("trouble", "wall_s", "cpu_s", "rss_gib", "floor")}
    hidden = {**case.hidden.effects, **case.hidden.unnamed}
    row: dict[str, Any] = {"exact": case.is_exact, "hidden": hidden, **cost}
    diagnosis = result.get("diagnosis")
    if diagnosis is None:
        return row | {"verdict": "failed"}
    row |= _effects(case, diagnosis) | _parameters(case, diagnosis["effects"])
    row |= _endings(diagnosis) | _errors(diagnosis, result)
    if case.told:
        row |= _unknowns(case.told, diagnosis, row)
        row["shape_r2"] = _shape_r2(case, result, row)
    return row


def unknowns_of(diagnosis: Mapping[str, Any]) -> list[dict[str, Any]]:
    """All unknown effects that a diagnosis tells; older ones tell one at most."""
    one = diagnosis.get("unknown")
    return list(diagnosis.get("unknowns") or ([one] if one else []))


def _effects(case: Case, diagnosis: Mapping[str, Any]) -> dict[str, Any]:
    hidden = set(case.hidden.effects)
    added = [
        entry["effect"] for entry in diagnosis["effects"] if ".py:" not in entry["effect"]
    ]  # plug-ins are unknowns
    named = {*added, *(name for entry in diagnosis["effects"] for name in entry.get("also_possible", []))}
    false = set(added) - hidden - {name for truth in case.told for name in truth.effects}
    ranking = diagnosis.get("ranking", [])[:_TOP]
    return {
        "verdict": diagnosis["verdict"],
        "added": added,
        "ranking": [f"{r['effect']} {r['delta_bic']:.0f} p={r['p_value']:.3g}" for r in ranking],
        "first_right": bool(added) and added[0] in hidden,
        "in_set": hidden <= named,
        "exact_set": set(added) == hidden and (bool(case.told) or not unknowns_of(diagnosis)),
        "false_additions": len(false),
        "no_false_effect": not false,
    }


def _endings(diagnosis: Mapping[str, Any]) -> dict[str, Any]:
    """What is told and listed beside catalogue effects; None where a version has no such list."""
    unknowns, unexplained = unknowns_of(diagnosis), diagnosis.get("unexplained")
    others = None if unexplained is None else [x for x in unexplained if "noise_shape" not in _covariates(x)]
    return {
        "unknowns": unknowns,
        "unexplained": unexplained,
        "alarm": bool(diagnosis["effects"]) or bool(unknowns),
        "unexplained_empty": None if unexplained is None else not unexplained,
        "unexplained_empty_but_shape": None if others is None else not others,
    }


def _errors(diagnosis: Mapping[str, Any], result: Mapping[str, Any]) -> dict[str, Any]:
    row: dict[str, Any] = {}
    floor, aligned = result.get("floor"), diagnosis.get("error_aligned")
    if floor:
        row["at_floor"] = (diagnosis["error_after"] if aligned is None else aligned) / floor
        row["poses_as_given"] = diagnosis["error_after"] / floor
    budget = diagnosis.get("budget")
    if budget:
        error = diagnosis.get("error", diagnosis["error_before"])
        row["budget_off"] = abs(sum(budget.values()) - error) / error
        row["budget_sums"] = row["budget_off"] <= _BUDGET_OFF
    if "held_out_after" in result and "held_out_before" in result:
        before, after, floor = (result[f"held_out_{key}"] for key in ("before", "after", "floor"))
        row |= {"held_out_before": before, "held_out_after": after, "held_out_ratio": after / floor}
        row["explained"] = (before - after) / (before - floor) if before > floor else None
    return row


def _unknowns(truths: list[Told], diagnosis: Mapping[str, Any], row: Mapping[str, Any]) -> dict[str, Any]:
    """Told: right channel and covariates among the unknowns, or a catalogue effect that says the same."""
    told, listed, channels = [], [], []
    unknowns, unexplained = row["unknowns"], row["unexplained"] or []
    for truth in truths:
        same = any(name in truth.effects for name in row["added"])
        told.append(same or any(truth.accepts(found) for found in unknowns))
        listed.append(any(truth.accepts(found) for found in unexplained))
        channels.append(same or any(truth.accepts_channel(found) for found in [*unknowns, *unexplained]))
    either = [one or other for one, other in zip(told, listed, strict=True)]
    claimed = [found.get("r2") for truth in truths for found in unknowns if truth.accepts(found)]
    return {
        "flagged": bool(unknowns),
        "right_channel": all(channels),
        "told": all(told),
        "listed": all(listed),
        "told_or_listed": all(either),
        "false_unknowns": sum(not any(truth.accepts(found) for truth in truths) for found in unknowns),
        "claimed_r2": min((r2 for r2 in claimed if r2 is not None), default=None),
    }


def _shape_r2(case: Case, result: Mapping[str, Any], row: Mapping[str, Any]) -> float | None:
    """Measured where it can be, else claimed, 0 where nothing is told; None for noise, which has no such shape."""
    if set(case.hidden.unnamed) == {"noise_shape"}:
        return None
    measured = result.get("shape_r2")
    return measured if measured is not None else row["claimed_r2"] or 0.0


def _covariates(finding: Mapping[str, Any]) -> list[str]:
    return finding.get("covariates") or []


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
