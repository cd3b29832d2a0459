"""What effects are worth to a detector: its average precision on scans of a twin measured with and without each.

The twin of every frame is traced and measured by the whole model, then by the model without one of its effects, with
the same streams of chance. A detector looks at each scan and is scored against the same labels. What an effect is
worth is the average precision that changes where it is left out. This module holds the figures.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

Interval = tuple[float, float]


@dataclass(frozen=True)
class EffectWorth:
    """An effect left out.

    Attributes:
        effect: its name.
        ap: average precision without it [%].
        change: that less the one with the whole model [points].
        ci95: of the change, over draws of the frames.
    """

    effect: str
    ap: float
    change: float
    ci95: Interval


@dataclass(frozen=True)
class Worth:
    """What the effects of a model are worth to a detector.

    Attributes:
        detector: which, for people.
        scored: what is scored, for people: class, metric, difficulty.
        frames, objects: how many.
        measured: average precision on the drive's own scans [%].
        model: on those of the whole model.
        gap, gap_ci95: the model's less the measured one [points].
        effects: each left out.
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
        """Plain values."""
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
                {"effect": one.effect, "ap": one.ap, "change": one.change, "ci95": list(one.ci95)}
                for one in self.effects
            ],
        }
