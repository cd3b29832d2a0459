"""Ablation of effects: average precision of a detector on simulated scans with and without each effect.

The twin of every frame is traced and measured with the complete model, then with the model without one of its effects,
using the same random seeds. The detector is run on each scan and scored against the same labels. The result for an
effect is the change of the average precision without it. This module contains the data types of the results.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

Interval = tuple[float, float]


@dataclass(frozen=True)
class EffectWorth:
    """Result for one effect.

    Attributes:
        effect: name of the effect.
        ap: average precision without it [%].
        change: `ap` minus the average precision with the complete model [percentage points].
        ci95: 95 % confidence interval of the change, from a bootstrap over frames.
    """

    effect: str
    ap: float
    change: float
    ci95: Interval


@dataclass(frozen=True)
class Worth:
    """Results for all effects of a model.

    Attributes:
        detector: human-readable name of the detector.
        scored: human-readable class, metric and difficulty.
        frames, objects: numbers of frames and of scored objects.
        measured: average precision on the drive's own scans [%].
        model: average precision on the scans of the complete model [%].
        gap, gap_ci95: `model` minus `measured` and its 95 % confidence interval [percentage points].
        effects: results for each removed effect.
    """

    detector: str
    scored: str
    frames: int
    objects: int
    measured: float
    model: float
    gap: float
    gap_ci95: Interval
    effects: tuple[EffectWorth, ...]

    def to_json(self) -> dict[str, Any]:
        """Values for JSON."""
        return {
            "detector": self.detector,
            "scored": self.scored,
            "frames": self.frames,
            "objects": self.objects,
            "ap_measured": self.measured,
            "ap_model": self.model,
            "gap": self.gap,
            "gap_ci95": list(self.gap_ci95),
            "effects": [
                {"effect": result.effect, "ap": result.ap, "change": result.change, "ci95": list(result.ci95)}
                for result in self.effects
            ],
        }
