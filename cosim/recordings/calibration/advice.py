"""Advice on the next recording: for each undetermined parameter, the drive that determines it best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cosim.discrepancy.data.checks import undetermined_effects
from cosim.recordings.calibration.manoeuvres import candidates, same_path, standard_errors
from sensors.effects.base import Effect
from sensors.effects.registry import effect_classes
from sensors.pattern import Pattern

_UNSURE = 0.25  # half width of an interval relative to the amplitude, above which a parameter is poorly determined
_HELPS = 1.5  # factor by which a recommended drive must narrow an interval
_MANY = 100


@dataclass(frozen=True)
class Advice:
    """A parameter that this recording does not determine.

    Attributes:
        effect, parameter: which.
        now: half width of its 95 % interval or smallest detectable value; null where that exceeds the allowed range.
        unit: of `now`.
        drive: what to do; empty where no candidate helps.
        narrower: by how many times the drive narrows the interval, at equal numbers of scans; null where this
            recording has no information on it.
    """

    effect: str
    parameter: str
    now: float | None
    unit: str
    drive: str
    narrower: float | None

    @property
    def words(self) -> str:
        """A sentence."""
        if not self.drive and self.effect in undetermined_effects(_MANY, True):
            return "no drive determines it with a map made from its own scans: provide a surveyed map"
        if not self.drive:
            return "no candidate drive gives much more information on it: record more scans like these"
        if self.narrower is None:
            return f"{self.drive}: this recording has no information on it"
        times = f"more than {_MANY}" if self.narrower > _MANY else f"{self.narrower:.1f}"
        return f"{self.drive}: its interval becomes {times} times narrower"

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return {**asdict(self), "words": self.words}


def undetermined(
    smallest: Mapping[str, Mapping[str, float | None]], findings: Mapping[str, Mapping[str, Any]]
) -> dict[tuple[str, str], float | None]:
    """Parameters that a recording leaves undetermined: effect and name, with half width or smallest detectable value.

    Args:
        smallest: smallest detectable amplitudes; None where they exceed the allowed range.
        findings: by effect `params` and `ci95` of what was found.
    """
    types, rows = effect_classes(), dict[tuple[str, str], float | None]()
    for name, values in smallest.items():
        kind = types.get(name)
        for parameter, value in values.items():
            if kind is None or name in findings or np.ndim(kind.example[parameter]):
                continue
            usual = abs(kind.example[parameter] - (kind.neutral or {}).get(parameter, 0.0))
            if value is None or value > usual:
                rows[name, parameter] = value
    for name, finding in findings.items():
        kind = types.get(name)
        for parameter, interval in finding["ci95"].items():
            value = finding["params"].get(parameter)
            if kind is None or np.ndim(value) or np.ndim(interval) != 1:
                continue
            half = (interval[1] - interval[0]) / 2
            neutral = (kind.neutral or {}).get(parameter, 0.0)
            if value is None or half > _UNSURE * abs(value - neutral):
                rows[name, parameter] = half
    return rows


def advise(
    rows: Mapping[tuple[str, str], float | None],
    poses: np.ndarray,
    height_m: float,
    pattern: Pattern,
    effects: Sequence[Effect],
) -> tuple[Advice, ...]:
    """The best candidate drive for every parameter.

    Args:
        rows: parameters, see `undetermined`.
        poses: (n, 4, 4) path of the recording.
        height_m: of the sensor above the ground.
        pattern: of the beams.
        effects: of the sensor.
    """
    if not rows:
        return ()
    never = set(undetermined_effects(len(poses), True))
    names = {effect for effect, _ in rows} - never
    known = [one for one in effects if one.name in effect_classes()]
    own = standard_errors(same_path(poses, height_m), pattern, known, names)
    drives = {
        one.words: standard_errors(one, pattern, known, names) for one in candidates(height_m, pattern.sweep_s)
    } if names else {}  # fmt: skip
    advice = []
    for (effect, parameter), now in rows.items():
        unit = next((one.unit for one in effect_classes()[effect].parameters() if one.name == parameter), "")
        errors = {words: found.get((effect, parameter), np.inf) for words, found in drives.items()}
        best = min(errors, key=lambda words: errors[words], default="")
        here = own.get((effect, parameter), np.inf)
        narrower = here / errors[best] if best and np.isfinite(errors[best]) else 0.0
        if np.isinf(narrower):
            advice.append(Advice(effect, parameter, now, unit, best, None))
        else:
            helps = narrower > _HELPS
            advice.append(Advice(effect, parameter, now, unit, best if helps else "", narrower if helps else None))
    return tuple(advice)
