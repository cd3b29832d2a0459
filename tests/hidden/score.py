"""Score one diagnosis against the truth of its case."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tests.hidden.amplitudes import STRENGTHS
from tests.hidden.cases import UNSEEN_GROUPS, Case
from tests.hidden.truth import Finding

_TOP = 5
_LEAST_EXPLAINED = 0.02  # share of the error above which the missing part of compare's budget is scored
_PLUG_IN = ".py:"


def score(case: Case, result: Mapping[str, Any]) -> dict[str, Any]:
    """One row of the benchmark.

    Args:
        case: what was hidden.
        result: what `run_case` gathered: truth, floor, costs and JSON of `diagnose` and `compare`, measured shapes.
    """
    truth, diagnose, compare = (result.get(key) or {} for key in ("truth", "diagnose", "compare"))
    row: dict[str, Any] = {
        "case": case.name,
        "group": case.group,
        "level": case.level,
        "kinds": list(truth.get("unseen", {})),
        "hidden": {**truth.get("effects", {}), **truth.get("unseen", {})},
        "trouble": diagnose.get("trouble") or compare.get("trouble") or "",
        "floor": result.get("floor"),
        **{f"{key}_{command}": of.get(key) for command, of in (("diagnose", diagnose), ("compare", compare))
           for key in ("cpu_s", "wall_s", "rss_gib")},
    }  # fmt: skip
    diagnosis = diagnose.get("json")
    if diagnosis is None:
        return row | {"verdict": "failed"}
    findings = [Finding.from_json(document) for document in truth.get("findings", [])]
    row |= _effects(set(truth.get("effects", {})), findings, diagnosis) | _errors(diagnosis, result)
    row |= _parameters(truth.get("effects", {}), diagnosis["effects"])
    row["detectable"] = _detectable(truth.get("effects", {}), diagnosis)
    row |= _budgets(diagnosis, compare.get("json"))
    if case.group in UNSEEN_GROUPS:
        row |= _unseen(findings, diagnosis, row)
        row["shape_r2"] = _shape_r2(findings, result, row)
    return row


def reported_unknowns(diagnosis: Mapping[str, Any]) -> list[dict[str, Any]]:
    """All reported unknown effects; older versions report one at most."""
    first = diagnosis.get("unknown")
    return list(diagnosis.get("unknowns") or ([first] if first else []))


def parsed_name(name: str) -> dict[str, Any]:
    """A name of an either-or set, `CHANNEL by COVARIATE, …`, as a finding; without covariates where it has none."""
    match = re.fullmatch(r"(?:unknown[_ ])?(.+?)[_ ]by[_ ](.+)", name)
    if not match:
        return {"channel": name, "covariates": []}
    covariates = re.split(r"\s*,\s*|\s+(?:x|×|and)\s+|_and_", match[2])
    return {"channel": match[1], "covariates": [covariate.strip() for covariate in covariates]}


def _effects(hidden: set[str], findings: list[Finding], diagnosis: Mapping[str, Any]) -> dict[str, Any]:
    added = [entry["effect"] for entry in diagnosis["effects"] if _PLUG_IN not in entry["effect"]]
    named = {*added, *(name for entry in diagnosis["effects"] for name in entry.get("also_possible") or [])}
    named |= {name for names in diagnosis.get("either_or") or [] for name in names}
    beside = {name for finding in findings for name in finding.beside}
    false = [
        name
        for name in added
        if name not in hidden | beside and not any(finding.names_effect(name) for finding in findings)
    ]
    ranking = (diagnosis.get("ranking") or [])[:_TOP]
    unknowns, unexplained = reported_unknowns(diagnosis), diagnosis.get("unexplained")
    is_silent = not diagnosis["effects"] and not unknowns
    return {
        "verdict": diagnosis["verdict"],
        "added": added,
        "ranking": [f"{entry['effect']} {entry['delta_bic']:.0f} p={entry['p_value']:.3g}" for entry in ranking],
        "unknowns": unknowns,
        "unexplained": unexplained,
        "first_right": bool(added) and added[0] in hidden,
        "in_set": hidden <= named,
        "exact_set": set(added) == hidden and not unknowns,
        "false_effects": false,
        "silent": is_silent and diagnosis["verdict"] == "none",
        "list_empty": None if unexplained is None else not unexplained,
        "null_right": is_silent and diagnosis["verdict"] == "none" and not unexplained,
    }


def _errors(diagnosis: Mapping[str, Any], result: Mapping[str, Any]) -> dict[str, Any]:
    floor, aligned = result.get("floor"), diagnosis.get("error_aligned")
    if not floor:
        return {}
    return {
        "at_floor": (diagnosis["error_after"] if aligned is None else aligned) / floor,
        "poses_as_given": diagnosis["error_after"] / floor,
    }


def _budgets(diagnosis: Mapping[str, Any], compare: Mapping[str, Any] | None) -> dict[str, Any]:
    """Largest difference between both budgets, and the missing part in `compare` over what `diagnose` explains.

    `diagnose` has the error of held-out frames only: its sources are scaled to what exceeds the noise in all frames.
    """
    first, second = diagnosis.get("budget"), (compare or {}).get("budget")
    if not first or not second or not compare:
        return {}
    error = compare["error"]
    excess = [sum(value or 0.0 for name, value in parts.items() if name != "noise") for parts in (first, second)]
    scale = excess[1] / excess[0] if excess[0] > 0 else 0.0
    sources = {*first, *second} - {"noise"}
    apart = {name: abs(scale * (first.get(name) or 0.0) - (second.get(name) or 0.0)) / error for name in sources}
    row: dict[str, Any] = {"budgets_apart": max(apart.values()), "budgets_agree": max(apart.values()) <= 0.1}
    explained = diagnosis["error_before"] - diagnosis["error_after"]
    if explained > _LEAST_EXPLAINED * error:
        row["missing_share"] = (second.get("missing") or 0.0) / explained
    return row


def _unseen(findings: list[Finding], diagnosis: Mapping[str, Any], row: Mapping[str, Any]) -> dict[str, Any]:
    """Reported: right channel and covariates among the unknowns, or a catalogue effect that says the same."""
    unknowns, unexplained = row["unknowns"], row["unexplained"] or []
    possible = [parsed_name(name) for names in diagnosis.get("either_or") or [] for name in names]
    same = [any(finding.names_effect(name) for name in row["added"]) for finding in findings]
    reported = [is_same or _any_accepts(finding, unknowns) for finding, is_same in zip(findings, same, strict=True)]
    listed = [_any_accepts(finding, unexplained) for finding in findings]
    in_set = [_any_accepts(finding, possible) for finding in findings]
    channel = [
        is_same or any(finding.accepts_channel(entry) for entry in [*unknowns, *unexplained])
        for finding, is_same in zip(findings, same, strict=True)
    ]
    false = [entry for entry in unknowns if not any(finding.accepts_part(entry) for finding in findings)]
    extra = [entry for entry in unexplained if not any(finding.accepts_part(entry) for finding in findings)]
    claimed = [entry.get("r2") for finding in findings for entry in unknowns if finding.accepts(entry)]
    names = set(row["hidden"])
    if row["added"]:
        is_first = row["added"][0] in names or any(finding.names_effect(row["added"][0]) for finding in findings)
    else:
        is_first = bool(unknowns) and any(finding.accepts(unknowns[0]) for finding in findings)
    either = [one or other for one, other in zip(reported, listed, strict=True)]
    return {
        "reported": all(reported),
        "reported_first": is_first,
        "listed": all(listed),
        "reported_or_listed": all(either) and (row["group"] != "unseen_catalogue" or row["in_set"]),
        "in_either_or": all(a or b for a, b in zip(in_set, reported, strict=True)),
        "right_channel": all(channel),
        "false_unknowns": len(false),
        "false_listed": len(extra),
        "has_false": bool(false) or bool(row["false_effects"]),
        "claimed_r2": min((r2 for r2 in claimed if r2 is not None), default=None),
    }


def _detectable(hidden: Mapping[str, Mapping], diagnosis: Mapping[str, Any]) -> bool | None:
    """Whether each hidden effect was found, or is as large as the diagnosis says that it detects.

    None if the diagnosis says nothing about an effect, for example because no beam meets what it acts on.
    """
    found, smallest = {entry["effect"] for entry in diagnosis["effects"]}, diagnosis.get("smallest_detectable") or {}
    answers = [
        True if name in found else _is_large(name, params, smallest.get(name)) for name, params in hidden.items()
    ]
    return None if None in answers else all(answers)


def _is_large(name: str, params: Mapping[str, Any], smallest: Mapping[str, float] | None) -> bool | None:
    """Whether an amplitude of an effect, in root mean square for lists, is at least the smallest detectable one."""
    if not smallest:
        return None
    changes = {key: np.asarray(params[key], float) - STRENGTHS[name].base for key in smallest if key in params}
    return any(float(np.sqrt(np.mean(change**2))) >= smallest[key] for key, change in changes.items())


def _any_accepts(finding: Finding, entries: Sequence[Mapping[str, Any]]) -> bool:
    return any(finding.accepts(entry) for entry in entries)


def _shape_r2(findings: list[Finding], result: Mapping[str, Any], row: Mapping[str, Any]) -> float | None:
    """Measured by a replay where it can be, else of the reported curve; 0 where nothing is reported.

    None where no shape exists: shared errors, and effects with more than one covariate that no replay shows.
    """
    if "shape_r2" in result:
        return result["shape_r2"]
    if len(findings) != 1 or findings[0].curve is None:
        return None
    found = [r2 for entry in row["unknowns"] if (r2 := curve_r2(findings[0], entry)) is not None]
    return max(found, default=0.0)


def curve_r2(finding: Finding, unknown: Mapping[str, Any]) -> float | None:
    """R² of a reported curve about the true one, both without their means; None where it cannot be compared."""
    true, curve = finding.curve, unknown.get("curve")
    if not true or not curve or not finding.accepts(unknown) or unknown.get("covariates") != [true["covariate"]]:
        return unknown.get("r2") if finding.accepts(unknown) else None
    x, y = (np.asarray(curve[key], float) for key in ("x", "y"))
    scale = np.pi / 180 if curve.get("x_unit", unknown.get("unit")) == "deg" and true["unit"] == "rad" else 1.0
    inside = np.isfinite(y) & (x * scale >= true["x"][0]) & (x * scale <= true["x"][-1])
    if inside.sum() < 3:
        return None
    expected = np.interp(x[inside] * scale, true["x"], true["y"])
    return r_squared(expected, y[inside] - y[inside].mean() + expected.mean())


def r_squared(true: np.ndarray, result: np.ndarray) -> float:
    """1 − squares left / squares about the mean."""
    about = float(((true - true.mean()) ** 2).sum())
    return 1 - float(((true - result) ** 2).sum()) / about if about else 0.0


def _parameters(hidden: Mapping[str, Mapping], effects: list[dict]) -> dict[str, Any]:
    """Relative errors of parameters by name, and which of the 95 % intervals include the truth."""
    errors: dict[str, float] = {}
    covered: list[bool] = []
    for entry in effects:
        for key, true in hidden.get(entry["effect"], {}).items():
            value = entry["params"].get(key)
            if isinstance(true, str) or value is None:
                continue
            errors[f"{entry['effect']}.{key}"] = relative_error(key, true, value)
            interval = (entry.get("ci95") or {}).get(key)
            if interval is not None and np.ndim(interval) == np.ndim(true) + 1:
                bounds = np.asarray(interval, float).reshape(-1, 2)
                covered += ((bounds[:, 0] <= np.ravel(true)) & (np.ravel(true) <= bounds[:, 1])).tolist()
    return {"parameter_errors": errors, "covered": covered}


def relative_error(key: str, true: Any, value: Any) -> float:
    """Of a number to itself, of an angle of phase to a turn, of a list in root mean square."""
    true, value = np.asarray(true, float), np.asarray(value, float)
    if true.shape != value.shape:
        return float("inf")
    if key in ("phase_deg", "azimuth_deg"):
        return float(abs((value - true + 180) % 360 - 180) / 360)
    scale = np.sqrt(np.mean(true**2))
    return float(np.sqrt(np.mean((value - true) ** 2)) / scale) if scale else float("nan")
