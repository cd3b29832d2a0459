"""Findings about drivers in words."""

from __future__ import annotations

from cosim.driver_discrepancy.behaviours import BEHAVIOURS
from cosim.driver_discrepancy.diagnosis import TrafficDiagnosis, TrafficFinding
from cosim.report.phrases import p_words, round_with_error

_NEEDED = ("speeding", "short_gap", "lane_offset")


def headline(diagnosis: TrafficDiagnosis) -> str:
    """The line that `cosim traffic-diagnose` says."""
    if not diagnosis.effects:
        smallest = smallest_words(diagnosis)
        left = unexplained_words(diagnosis)
        if left:
            return f"unknown: {left}; no behaviour of the catalogue explains it; {_errors(diagnosis)}"
        return _nothing(diagnosis) + (f"; would have been detected: {smallest}" if smallest else "")
    parts = [finding_words(one) for one in diagnosis.effects]
    parts[0] = f"{diagnosis.verdict}: {parts[0]}"
    before, after = diagnosis.error_before, diagnosis.error_after
    fall = f"held-out error {before:.3f} → {after:.3f}, noise floor {diagnosis.noise_floor:.3f}"
    left = unexplained_words(diagnosis)
    return "; ".join([*parts, *([f"left unexplained: {left}"] if left else []), fall])


def finding_words(one: TrafficFinding) -> str:
    """A finding with its parameters."""
    similar = f"; not separable from {', '.join(one.also_possible)}" if one.also_possible else ""
    where = f" on {len(one.streets)} streets" if one.streets else ""
    worse = f"; makes worse: {', '.join(one.worse)}" if one.worse else ""
    return f"{one.behaviour}{where} ({parameter_words(one)}), {p_words(one.p_value)}{similar}{worse}"


def parameter_words(one: TrafficFinding) -> str:
    """All parameters with half their intervals."""
    parts = []
    for name in one.params:
        value, half = fitted_words(one, name)
        parts.append(f"{name} {value}{half and f' ± {half}'}")
    return ", ".join(parts)


def fitted_words(one: TrafficFinding, name: str) -> tuple[str, str]:
    """A fitted value with its unit, to as many digits as its interval bears, and half of that; empty without one."""
    value = one.params[name]
    if name not in one.ci95:
        return quantity(one.behaviour, name, value), ""
    low, high = one.ci95[name]
    number, half = round_with_error(value, (high - low) / 2)
    return f"{number}{_unit(one.behaviour, name)}", half


def quantity(behaviour: str, name: str, value: float) -> str:
    """A value with its unit."""
    return f"{value:.3g}{_unit(behaviour, name)}"


def _unit(behaviour: str, name: str) -> str:
    """Unit of a parameter, after a space if it has one."""
    unit = next(knob.unit for knob in BEHAVIOURS[behaviour].knobs if knob.name == name)
    return f" {unit}" if unit else ""


def smallest_words(diagnosis: TrafficDiagnosis, names: tuple[str, ...] = _NEEDED) -> str:
    """Changes that would have been seen, of the first parameter of some behaviours."""
    parts = []
    for name in names:
        values = diagnosis.smallest_detectable.get(name, {})
        first = next(iter(values), None)
        if first is not None:
            parts.append(f"{name} from a change of {first} by {quantity(name, first, values[first])}")
    return ", ".join(parts)


def unexplained_words(diagnosis: TrafficDiagnosis) -> str:
    """Columns that still differ."""
    return ", ".join(row.place for row in diagnosis.unexplained)


def _nothing(diagnosis: TrafficDiagnosis) -> str:
    """The line for no finding: error and floor belong to it."""
    return f"no missing behaviour is significant; {_errors(diagnosis)}"


def _errors(diagnosis: TrafficDiagnosis) -> str:
    return f"held-out error {diagnosis.error_before:.3f}, noise floor {diagnosis.noise_floor:.3f}"
