"""What is significant about a model: the matrix channel × covariate, and what remains in the end."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cosim.discrepancy.selection.refit import Model
from cosim.discrepancy.selection.search import Evidence, is_explained
from cosim.discrepancy.selection.table import GroupTest
from cosim.discrepancy.settings import Settings
from cosim.discrepancy.unknown.curve import CHANNEL_UNITS, Axis

UNITS = {**CHANNEL_UNITS, "spurious": "", "pose": ""}


@dataclass(frozen=True, eq=False)
class EvidenceCurve:
    """Coefficients of one Gauss–Newton step by bin of one covariate: the statistic that is tested.

    Attributes:
        x: (b,) centres of bins, or names of categories.
        y, sigma: (b,) change of the channel and its standard error, in the channel's unit.
        unit: of the covariate; empty for pure numbers and categories.
    """

    x: Axis
    y: np.ndarray
    sigma: np.ndarray
    unit: str

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        x = list(self.x) if isinstance(self.x, tuple) else self.x.tolist()
        return {"x": x, "y": self.y.tolist(), "sigma": self.sigma.tolist(), "unit": self.unit}


@dataclass(frozen=True, eq=False)
class EvidenceCell:
    """One cell of the matrix channel × covariate.

    Attributes:
        channel, covariates: what is tested against what.
        gain, p_value: of the initial model: log-likelihood on clusters that took no part in the fit, and family-wise p.
        gain_after, p_value_after: of the final model.
        before, after: curves of both models where the covariate has bins; None for others.
    """

    channel: str
    covariates: tuple[str, ...]
    gain: float
    p_value: float
    gain_after: float
    p_value_after: float
    before: EvidenceCurve | None = None
    after: EvidenceCurve | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain values, without the curves."""
        return {
            "channel": self.channel,
            "covariates": list(self.covariates),
            "gain": self.gain,
            "p_value": self.p_value,
            "gain_after": self.gain_after,
            "p_value_after": self.p_value_after,
        }


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


def remaining(evidence: Evidence, model: Model, settings: Settings, least_gain: float) -> tuple[Unexplained, ...]:
    """Everything that is still significant, the largest gain first.

    Args:
        evidence: about the final model.
        model: with its terms.
        settings: numeric choices.
        least_gain: log-likelihood that the fit of the findings cannot be exact to.
    """
    found = []
    for result in evidence.significant(settings):
        if result.gain < least_gain or is_explained(result.group, model):
            continue
        group = result.group
        name = group.effect_name
        found.append(
            Unexplained(group.channel, group.covariates, _size(result, evidence), UNITS.get(group.channel, ""),
                        result.p_value, name)
        )  # fmt: skip
    return tuple(found[: settings.selection.listed])


def evidence_matrix(before: Evidence, after: Evidence) -> tuple[EvidenceCell, ...]:
    """Cells of all dependences that either first pass kept, the largest gain before first."""
    first = {result.group.name: result for result in before.results if not result.group.is_effect}
    last = {result.group.name: result for result in after.results if not result.group.is_effect}
    cells = []
    for name in dict.fromkeys((*first, *last)):
        old, new = first.get(name), last.get(name)
        group = (old or new or after.results[0]).group
        cells.append(
            EvidenceCell(group.channel, group.covariates, *_figures(old), *_figures(new), _curve(old), _curve(new))
        )
    return tuple(sorted(cells, key=lambda cell: -max(cell.gain, cell.gain_after)))


def _figures(result: GroupTest | None) -> tuple[float, float]:
    return (0.0, 1.0) if result is None else (max(result.gain, 0.0), result.p_value)


def _curve(result: GroupTest | None) -> EvidenceCurve | None:
    if result is None or result.group.covariate is None or result.group.kept is None:
        return None
    covariate, kept = result.group.covariate, result.group.kept
    if len(covariate.names) > 1 or covariate.name == "constant":
        return None
    information = np.maximum(np.diag(result.entry.information), 1e-300)
    y = result.entry.score / information
    sigma = np.sqrt(result.entry.variance) / information
    if result.group.is_count:  # in units of the reference share
        y, sigma = y * result.entry.unit, sigma * result.entry.unit
    x = tuple(covariate.labels[row] for row in kept) if covariate.labels else covariate.centres[kept]
    return EvidenceCurve(x, y, sigma, covariate.unit)


def _size(result: GroupTest, evidence: Evidence) -> float:
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
