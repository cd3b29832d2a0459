"""The matrix channel × covariate: gain and significance of every dependence before and after the findings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.discrepancy.dictionary.covariates import SampleCovariate
from cosim.discrepancy.selection.evidence import SelectionEvidence
from cosim.discrepancy.selection.table import GroupTest
from cosim.discrepancy.unknown.curve import Axis

_OBJECT_AXES = ("length", "width", "height")


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


@dataclass(frozen=True, eq=False)
class EvidenceGrid:
    """Coefficients of one Gauss–Newton step by bin of two covariates.

    Attributes:
        x: (a,) centres of the bins of the first covariate, or names of categories.
        across: (b,) of the second one.
        y, sigma: (a, b) change of the channel and its standard error, in the channel's unit; NaN in bins without beams.
    """

    x: Axis
    across: Axis
    y: np.ndarray
    sigma: np.ndarray


@dataclass(frozen=True, eq=False)
class EvidenceCell:
    """One cell of the matrix channel × covariate.

    Attributes:
        channel, covariates: what is tested against what.
        gain, p_value: of the initial model: log-likelihood on clusters that took no part in the fit, and family-wise p.
        gain_after, p_value_after: of the final model.
        name: name of the hypothesis, with a class of objects, a number of waves or a frequency if it has one.
        before, after: coefficients by bin of both models; None where the hypothesis has no bins.
        is_rejected: whether its exact refit gained no more than chance.
    """

    channel: str
    covariates: tuple[str, ...]
    gain: float
    p_value: float
    gain_after: float
    p_value_after: float
    name: str = ""
    before: EvidenceCurve | EvidenceGrid | None = None
    after: EvidenceCurve | EvidenceGrid | None = None
    is_rejected: bool = False

    def to_json(self) -> dict[str, Any]:
        """Plain values, without the coefficients."""
        return {
            "channel": self.channel,
            "covariates": list(self.covariates),
            "gain": self.gain,
            "p_value": self.p_value,
            "gain_after": self.gain_after,
            "p_value_after": self.p_value_after,
        }


def evidence_matrix(before: SelectionEvidence, after: SelectionEvidence) -> tuple[EvidenceCell, ...]:
    """Cells of all dependences that either first pass kept, the largest gain before first."""
    first = {result.group.name: result for result in before.results if not result.group.is_effect}
    last = {result.group.name: result for result in after.results if not result.group.is_effect}
    cells = []
    for name in dict.fromkeys((*first, *last)):
        old, new = first.get(name), last.get(name)
        group = (old or new or after.results[0]).group
        cells.append(
            EvidenceCell(
                group.channel, group.covariates, *_figures(old), *_figures(new), name, _coefficients(old),
                _coefficients(new), name in after.rejected,
            )
        )  # fmt: skip
    return tuple(sorted(cells, key=lambda cell: -max(cell.gain, cell.gain_after)))


def _figures(result: GroupTest | None) -> tuple[float, float]:
    return (0.0, 1.0) if result is None else (max(result.gain, 0.0), result.p_value)


def _coefficients(result: GroupTest | None) -> EvidenceCurve | EvidenceGrid | None:
    """One Gauss–Newton step with its standard errors, by bin."""
    if result is None:
        return None
    group, entry = result.group, result.entry
    information = np.maximum(np.diag(entry.information), 1e-300)
    unit = entry.unit if group.is_count else 1.0  # counts are in units of the reference share
    y, sigma = unit * entry.score / information, unit * np.sqrt(entry.variance) / information
    if group.covariates[-1:] in (("object_size",), ("object_place",)) and len(y) == len(_OBJECT_AXES):
        return EvidenceCurve(_OBJECT_AXES, y, sigma, "")
    covariate, kept = group.covariate, group.kept
    if covariate is None or kept is None or covariate.name == "constant":
        return None
    if not covariate.parts:
        return EvidenceCurve(_bin_positions(covariate, kept), y, sigma, covariate.unit)
    first, second = covariate.parts
    tables = []
    for values in (y, sigma):
        table = np.full(len(first) * len(second), np.nan)
        table[kept] = values
        tables.append(table.reshape(len(first), len(second)))
    ends = [_bin_positions(part, np.arange(len(part))) for part in (first, second)]
    return EvidenceGrid(ends[0], ends[1], tables[0], tables[1])


def _bin_positions(covariate: SampleCovariate, bins: np.ndarray) -> Axis:
    return tuple(covariate.labels[row] for row in bins) if covariate.labels else covariate.centres[bins]
