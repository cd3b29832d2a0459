"""Dependences that are still significant about the final model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cosim.discrepancy.selection.choice import needed_gain
from cosim.discrepancy.selection.evidence import SelectionEvidence
from cosim.discrepancy.selection.refit import FittedModel
from cosim.discrepancy.selection.search import is_explained
from cosim.discrepancy.selection.table import GroupTest
from cosim.discrepancy.settings import Settings
from cosim.discrepancy.unknown.curve import CHANNEL_UNITS

UNITS = {**CHANNEL_UNITS, "spurious": "", "pose": ""}


@dataclass(frozen=True)
class Unexplained:
    """A significant dependence that no finding explains.

    Attributes:
        channel, covariates: what depends on what; no covariates where it resembles an effect.
        size: root mean square of the change over the beams that it concerns.
        unit: of the size; empty for shares.
        p_value: family-wise.
        resembles: the effect that would look like this; empty for dependences.
    """

    channel: str
    covariates: tuple[str, ...]
    size: float
    unit: str
    p_value: float
    resembles: str = ""

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self) | {"covariates": list(self.covariates)}

    @classmethod
    def of_json(cls, values: Mapping[str, Any]) -> Unexplained:
        """A dependence from plain values; a size of None is unknown."""
        size = float("nan") if values["size"] is None else values["size"]
        return cls(**{**values, "covariates": tuple(values["covariates"]), "size": size})


def remaining(evidence: SelectionEvidence, model: FittedModel, settings: Settings) -> tuple[Unexplained, ...]:
    """Dependences that are still significant and larger than the numerical accuracy of the fit, by gain.

    Args:
        evidence: about the final model.
        model: with its terms.
        settings: numeric choices.
    """
    found = []
    for result in evidence.significant(settings):
        is_needed = result.gain >= needed_gain(result.group, model, settings)  # false for NaN
        if not is_needed or is_explained(result.group, model):
            continue
        group = result.group
        name = group.effect_name
        found.append(
            Unexplained(group.channel, group.covariates, _size(result, evidence), UNITS.get(group.channel, ""),
                        result.p_value, name)
        )  # fmt: skip
    return tuple(found[: settings.selection.listed])


def _size(result: GroupTest, evidence: SelectionEvidence) -> float:
    """Root mean square change: with information I of every beam a change of d everywhere gains ½ Σ I d²."""
    group = result.group
    if group.is_shared:
        information = float(result.entry.information[0, 0])
        return float(np.sqrt(max(float(result.entry.score[0]) / max(information, 1e-300), 0.0)))
    if not group.columns or group.channel not in evidence.linearisation.channels:
        return 0.0
    rows = np.zeros(len(evidence.linearisation.sample), bool)
    for matrix in group.columns.values():
        rows |= np.diff(matrix.tocsr().indptr) > 0
    known = float(evidence.linearisation.weights(group.channel)[1][rows].sum())
    size = float(np.sqrt(2 * max(result.gain, 0.0) / known)) if known > 0 else 0.0
    return size * result.entry.unit if group.is_count else size
