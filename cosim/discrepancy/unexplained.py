"""What is still significant after the last fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cosim.discrepancy.groups.dependences import scale
from cosim.discrepancy.inference.fit import Fitted
from cosim.discrepancy.inference.score_test import Tested
from cosim.discrepancy.settings import Settings

_UNITS = {"range": "m", "intensity": "", "drop": "", "spurious": "", "range_variance": "", "intensity_variance": ""}


@dataclass(frozen=True)
class Unexplained:
    """A dependence of residuals that nothing found explains.

    Attributes:
        channel, covariates: of what on what.
        size: root mean square of it over the beams that it is told of.
        unit: of the size; empty for shares.
        p_value: family-wise, of it alone.
        looks_like: the effect whose trace it is like; empty for dependences.
    """

    channel: str
    covariates: tuple[str, ...]
    size: float
    unit: str
    p_value: float
    looks_like: str = ""

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self) | {"covariates": list(self.covariates)}


def unexplained(tested: Sequence[Tested], fitted: Fitted, settings: Settings) -> tuple[Unexplained, ...]:
    """Everything that is significant, the surest first; of an effect its channel."""
    found: list[Unexplained] = []
    seen = set[str]()
    for one in tested:
        if one.p_value > settings.level or one.group.name in seen:
            continue
        seen.add(one.group.name)
        name, channel = one.group.name if one.group.is_effect else "", one.group.channel
        size, unit = _size(one, fitted), _UNITS.get(channel, "")
        found.append(Unexplained(channel, one.group.covariates, size, unit, one.p_value, name))
    found.sort(key=lambda one: (one.p_value, bool(one.looks_like)))
    return tuple(found[: settings.pick.unexplained])


def _size(one: Tested, fitted: Fitted) -> float:
    """Root mean square of the change that beams tell of, what random effects and parameters take up left out.

    With information I of every beam a change of d everywhere gains ½ Σ I d².
    """
    found = next(iter(one.group.columns.items()), None)
    if found is None:
        return float("nan")
    quantity, columns = found
    told = fitted.evidence.information[quantity] * (np.diff(columns.tocsr().indptr) > 0)
    known = float(told @ scale(fitted, quantity) ** 2)
    return float(np.sqrt(2 * max(one.gain, 0.0) / known)) if known > 0 else 0.0
