"""Result of the two-sample test."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Separation:
    """Separability of two sets.

    Attributes:
        auc: area under the ROC curve of patches that took no part in training; 0.5: not at all, 1: always.
        low, high: 95 % interval over units, for the classifiers as they were trained.
        p_value: of equal sets, by permutation of the units held out of each fold; None if not requested.
    """

    auc: float
    low: float
    high: float
    p_value: float | None = None

    def as_json(self) -> dict[str, Any]:
        """Its keys in JSON."""
        values: dict[str, Any] = {"auc": self.auc, "ci95": [self.low, self.high]}
        return values if self.p_value is None else {**values, "p_value": self.p_value}


@dataclass(frozen=True)
class ChannelResult:
    """A channel's figures: the two sets, and the reference's two halves."""

    channel: str
    sets: Separation
    baseline: Separation | None


@dataclass(frozen=True, eq=False)
class FigureResult:
    """One figure by itself.

    Attributes:
        key, title, channel: of the figure.
        auc: AUC of this feature by itself, 0.5–1.
        is_larger: whether it is larger in the first set.
        quantiles: 5, 25, 50, 75, 95 % of both sets.
        edges: (k + 1,) of a histogram.
        shares: (2, k) share of patches.
    """

    key: str
    title: str
    channel: str
    auc: float
    is_larger: bool
    quantiles: tuple[list[float], list[float]]
    edges: np.ndarray
    shares: np.ndarray

    def as_json(self) -> dict[str, Any]:
        """Its keys in JSON, without the histogram."""
        return {
            "figure": self.key,
            "channel": self.channel,
            "auc": self.auc,
            "larger_in_set": self.is_larger,
            "quantiles": {"p": [5, 25, 50, 75, 95], "set": self.quantiles[0], "against": self.quantiles[1]},
        }


@dataclass(frozen=True)
class RegionResult:
    """Separability of patches with a large share of a region."""

    region: str
    title: str
    patches: tuple[int, int]
    auc: dict[str, float]


@dataclass(frozen=True, eq=False)
class TellingPatch:
    """A patch that its set's classifier recognises best.

    Attributes:
        frame: name of the frame.
        place: row and column of the patch.
        probability: of its set, by a classifier that has not seen its unit.
        picture: (2, rows, columns) float16 ranges [m] and intensities.
    """

    frame: str
    place: tuple[int, int]
    probability: float
    picture: np.ndarray

    def as_json(self) -> dict[str, Any]:
        """Location of the patch."""
        return {"frame": self.frame, "patch": list(self.place), "probability": self.probability}


@dataclass(frozen=True, eq=False)
class TwoSample:
    """The test of a set against a reference.

    Attributes:
        channels: `all` first, then each channel.
        figures: single features, by their AUC.
        regions: where both sets have patches of a region.
        telling: the most telling patches of the first set and of the reference.
        information: sizes and settings.
    """

    channels: tuple[ChannelResult, ...]
    figures: tuple[FigureResult, ...]
    regions: tuple[RegionResult, ...]
    telling: tuple[tuple[TellingPatch, ...], tuple[TellingPatch, ...]]
    information: dict[str, Any] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """The value of `two_sample` in JSON."""
        return {
            **self.information,
            "channels": {
                item.channel: {
                    **item.sets.as_json(),
                    "baseline": None if item.baseline is None else item.baseline.as_json(),
                }
                for item in self.channels
            },
            "figures": [item.as_json() for item in self.figures],
            "regions": [asdict(item) for item in self.regions],
            "telling": {
                name: [patch.as_json() for patch in patches]
                for name, patches in zip(("set", "against"), self.telling, strict=True)
            },
        }
