"""First pass over the dictionary: keeps the most promising groups of each channel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy import sparse, special

from cosim.discrepancy.dictionary.build import Dictionary
from cosim.discrepancy.dictionary.groups import Group, binned_group, family_of, is_tested
from cosim.discrepancy.dictionary.linearisation import Linearisation
from cosim.discrepancy.inference.dependence import MEANS
from cosim.discrepancy.inference.projection import PART, TRACK, Projector
from cosim.discrepancy.inference.score import SparseMatrix
from cosim.discrepancy.settings import Settings

_LEAST_SURPRISE = 0.2  # −ln p of a group below which it is not looked at further


def first_pass(
    linearisation: Linearisation, dictionary: Dictionary, projectors: Mapping[str, Projector], settings: Settings
) -> list[Group]:
    """All effects of the catalogue, and the most significant dependences of each channel.

    Dependences are ranked by significance and by all that they may gain. Nothing is eliminated here: near an
    optimum the plain score is the efficient one, and its variance is an upper bound.

    Args:
        linearisation: of the model.
        dictionary: all hypotheses.
        projectors: by family of channels.
        settings: numeric choices.
    """
    always = [group for group in dictionary.explicit if group.direct is not None or group.is_effect]
    others = [group for group in dictionary.explicit if group not in always]
    kept = [*always, *_best(_rank_explicit(linearisation, others, projectors), settings.selection.kept)]
    for channel in linearisation.channels:
        rows = _rank_binned(linearisation, channel, dictionary, projectors[family_of(channel)], settings)
        names = {group.name: group for _, _, group in rows}
        best = _best(rows, settings.selection.kept)
        for group in list(best):  # of a pair its covariates, too
            mains = (names.get(f"{channel} by {name}") for name in group.covariates if len(group.covariates) > 1)
            best += [main for main in mains if main is not None and main not in best]
        kept += best
    return kept


_Row = tuple[float, float, Group]


def _best(rows: Sequence[_Row], most: int) -> list[Group]:
    """The first so many of each channel by either figure."""
    kept: list[Group] = []
    by_significance = sorted(rows, key=lambda row: -row[0])
    by_gain = sorted(rows, key=lambda row: -row[1])
    for ordered in (by_significance, by_gain):
        count: dict[str, int] = {}
        for row in ordered:
            channel = row[2].channel
            if count.get(channel, 0) < most and row[2] not in kept:
                kept.append(row[2])
            count[channel] = count.get(channel, 0) + 1
    return kept


def _rank_binned(
    linearisation: Linearisation, channel: str, dictionary: Dictionary, projector: Projector, settings: Settings
) -> list[_Row]:
    """All bins of one channel in one product."""
    tested = [covariate for covariate in dictionary.covariates.values() if is_tested(channel, covariate)]
    basis: SparseMatrix = sparse.hstack([covariate.basis for covariate in tested], format="csr")
    score, information = linearisation.weights(channel)
    figures = _figures(basis, score, information, linearisation.sample.share, projector)
    one_sided = linearisation.channels[channel].one_sided
    rows, end = [], 0
    for covariate in tested:
        columns = slice(end, end + len(covariate))
        end += len(covariate)
        pair = len(covariate.names) > 1
        fewest = (
            settings.dictionary.fewest_in_cell if pair or channel not in MEANS else settings.dictionary.fewest_in_bin
        )
        significance, most = _summary(figures, columns, one_sided)
        if significance > _LEAST_SURPRISE:
            group = binned_group(linearisation, channel, covariate, fewest)
            if group is not None:
                rows.append((significance, most, group))
    return rows


def _rank_explicit(
    linearisation: Linearisation, groups: Sequence[Group], projectors: Mapping[str, Projector]
) -> list[_Row]:
    rows = []
    share = linearisation.sample.share
    for group in groups:
        if not group.columns:
            continue
        parts = []
        for name, matrix in group.columns.items():
            score, information = linearisation.evidence.score[name], linearisation.evidence.information[name]
            parts.append(_figures(matrix.tocsr(), score, information, share, projectors[group.family]))
        track = sum(part[0] for part in parts)
        scatter, floor = (sum(part[position] for part in parts) for position in (1, 2))
        rows.append((*_summary((track, scatter, floor), slice(None), group.one_sided), group))  # type: ignore[arg-type]
    return rows


_Figures = tuple[np.ndarray, np.ndarray, np.ndarray]


def _figures(
    basis: SparseMatrix,
    score: np.ndarray,
    information: np.ndarray,
    share: np.ndarray,
    projector: Projector,
) -> _Figures:
    """Score, variance by clusters, and variance that the information implies, (k,) each."""
    tables = projector.plain(basis, score)
    square = basis.power(2)
    scatter = np.maximum(*((table**2).sum(0) for table in (tables[TRACK], tables[PART])))
    return tables[TRACK].sum(0), scatter, square.T @ (information * share)


def _summary(figures: _Figures, columns: slice, one_sided: bool) -> tuple[float, float]:
    """Significance and twice the predicted gain.

    The significance is −ln p of the sum of the squared standardised scores, or of the largest of them if this is more.
    """
    score, scatter, floor = (values[columns] for values in figures)
    used = floor > 0
    if not used.any():
        return -np.inf, -np.inf
    score, scatter, floor = score[used], scatter[used], floor[used]
    z = score / np.sqrt(np.maximum(scatter, floor))
    square = np.maximum(z, 0) ** 2 if one_sided else z**2
    count = len(z)
    significance = max(_surprise(square.sum(), count), _surprise(square.max(), 1) - np.log(count))
    return float(significance), float(np.sum(score**2 / floor) - count)


def _surprise(value: float, degrees: int) -> float:
    """−ln p of a χ² value, by the cube root of Wilson and Hilferty (PNAS 1931): finite however large it is."""
    spread = 2 / (9 * degrees)
    return -float(special.log_ndtr((1 - spread - np.cbrt(value / degrees)) / np.sqrt(spread)))
