"""Dependences that ask what is off without an effect's name: on a covariate, a pair, a scan, a phase, or the noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from scipy import sparse

from cosim.discrepancy.groups.covariates import OF_SCANS, Covariate, covariates
from cosim.discrepancy.inference.columns import SparseMatrix
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.group import Channel, Group
from cosim.discrepancy.inference.score import Quantity

MEANS: tuple[Quantity, ...] = ("range", "intensity", "drop")
SPREADS: tuple[Quantity, ...] = ("range_variance", "intensity_variance")
_PAIRED = ("range", "incidence", "elevation", "azimuth", "albedo", "previous_intensity")
_OF_SPREADS = ("range", "incidence", "elevation", "block", "azimuth", "intensity", "material", "frame_time")
_KNOWN = (("range", "ring"), ("intensity", "ring"), ("range", "block"))  # the catalogue has a number a laser for these


def of_covariates(fitter: Fitter, fitted: Fitted) -> Iterator[Group]:
    """Every channel by every covariate, a number a bin."""
    by = fitter.settings.screen
    for covariate in covariates(fitter.sample, fitted.prediction, by.bins):
        for channel in (*MEANS, *SPREADS):
            if (channel, covariate.name) in _KNOWN or channel not in fitted.evidence.score:
                continue
            if channel in SPREADS and covariate.name not in _OF_SPREADS:
                continue
            if covariate.of_neighbours and (channel in SPREADS or (channel, covariate.name[-4:]) == ("drop", "nsit")):
                continue  # their noise is this beam's, too
            found = binned_group(fitted, channel, covariate, by.fewest_in_bin)
            if found is not None:
                yield found


def binned_group(fitted: Fitted, channel: Quantity, covariate: Covariate, fewest: int) -> Group | None:
    """A channel by the bins of a covariate that enough beams are in; None if these are fewer than two."""
    information = fitted.evidence.information[channel]
    used = (covariate.bin >= 0) & (information > 0)
    count = np.bincount(covariate.bin[used], minlength=len(covariate.centres))
    kept = np.flatnonzero(count >= fewest)
    if len(kept) < (1 if covariate.name == "kind" else 2):
        return None
    place = np.full(len(covariate.centres) + 1, -1)
    place[kept] = np.arange(len(kept))
    row = np.where(used, place[covariate.bin], -1)
    mine = np.flatnonzero(row >= 0)
    values = scale(fitted, channel)[mine]
    columns = sparse.csr_matrix((values, (mine, row[mine])), (len(row), len(kept)))
    name = f"{channel} by {covariate.name}"
    return Group(name, channel, {channel: columns}, len(kept), (covariate.name,))


def of_pairs(fitter: Fitter, fitted: Fitted) -> Iterator[Group]:
    """Every channel by products of two covariates' smooth functions."""
    by = fitter.settings.screen
    found = {one.name: one for one in covariates(fitter.sample, fitted.prediction, by.bins)}
    basis = {name: found[name].basis(by.degree) for name in _PAIRED if name in found}
    for one, other in combinations(basis, 2):
        both = basis[one][:, :, None] * basis[other][:, None, :]
        table = both.reshape(len(both), -1)
        for channel in MEANS:
            if channel in fitted.evidence.score:
                columns = sparse.csr_matrix(table * scale(fitted, channel)[:, None])
                name = f"{channel} by {one} and {other}"
                yield Group(name, channel, {channel: columns}, table.shape[1], (one, other))


def main_effects(fitter: Fitter, fitted: Fitted) -> dict[Quantity, SparseMatrix]:
    """Smooth functions of each covariate alone, by channel: what a pair must explain more than."""
    parts, by = [np.ones((len(fitter.sample), 1))], fitter.settings.screen
    for one in covariates(fitter.sample, fitted.prediction, by.bins):
        if one.name in _PAIRED:
            parts.append(one.basis(by.main_degree))
    table = np.hstack(parts)
    return {
        channel: sparse.csr_matrix(table * scale(fitted, channel)[:, None])
        for channel in MEANS
        if channel in fitted.evidence.score
    }


def of_scans(fitter: Fitter, fitted: Fitted) -> Iterator[Group]:
    """A level of its own for each scan; scans themselves are no clusters then."""
    sample = fitter.sample
    scans = len(sample.names)
    rows = np.arange(len(sample))
    for channel in MEANS:
        if channel in fitted.evidence.score and scans > 2:
            columns = sparse.csr_matrix((scale(fitted, channel), (rows, sample.frame)), (len(rows), scans))
            yield Group(f"{channel} by scan", channel, {channel: columns}, scans, ("scan",), by_scan=False)


def of_noise(fitter: Fitter, fitted: Fitted) -> Iterator[Group]:
    """The noise's shape: two humps or cut tails leave too few residuals near 0, a skew more on one side.

    Residuals are normal deviates if the noise is Gaussian; of what has heavier tails and one hump more are near 0, so
    that only too few count. The score of a column is what is counted; its information the variance of that.
    """
    hump = fitter.settings.screen.hump
    mean = hump / np.sqrt(1 + hump**2)
    for channel, z, used in _deviates(fitter, fitted):
        near = np.exp(-((z / hump) ** 2) / 2)
        for name, values, one_sided in (
            ("too few residuals near 0", np.where(used, mean - near, 0.0), True),
            ("skewed", np.where(used, z * np.exp(-(z**2) / 2) - z / (2 * np.sqrt(2)), 0.0), False),
        ):
            yield Group(
                f"{channel} noise {name}", channel, {}, 1, ("noise_shape",), one_sided=one_sided, label=name,
                gain=fitter.sample.share * values,
            )  # fmt: skip


def _deviates(fitter: Fitter, fitted: Fitted) -> Iterator[tuple[Channel, np.ndarray, np.ndarray]]:
    """Residuals of ranges and intensities over their own spread, and which tell of noise."""
    fit, by = fitted.fit, fitter.settings.screen
    of_channel: dict[Channel, tuple[np.ndarray, np.ndarray, np.ndarray, float]] = {
        "range": (fit.range_z, fit.matched > 0.9, fit.range_sigma_m, by.least_noise_m),
        "intensity": (fit.intensity_z, (fit.bright > 0.9) & fit.whole, fit.intensity_sigma, by.least_noise),
    }
    for channel, (z, clean, sigma, least) in of_channel.items():
        used = clean & fitter.sample.returned & (sigma > least) & (fitter.sample.unsure_m <= 0)
        if used.sum() > by.fewest_residuals:
            middle = z - np.median(z[used])
            spread = np.sqrt(np.mean(np.minimum(middle[used] ** 2, 16.0)))
            yield channel, middle / max(float(spread), 1e-9), used


def scale(fitted: Fitted, channel: Quantity) -> np.ndarray:
    """(n,) what a unit of a dependence is: intensities and chances of a return change in proportion to themselves."""
    if channel == "intensity":
        return fitted.prediction.intensity
    if channel == "drop":
        return fitted.prediction.seen
    return np.ones(len(fitted.prediction.seen))


def depends_on_scans(names: Sequence[str]) -> bool:
    """Whether any of some covariates is the same for all beams of a scan."""
    return any(name in (*OF_SCANS, "scan") for name in names)


def of_phases(fitter: Fitter, fitted: Fitted, rng: np.random.Generator) -> Iterator[Group]:
    """The strongest wave of each channel, if it stands out of all others: the largest line of the periodogram.

    Its null law is that of the largest line when scans have random signs.
    """
    sample, by = fitter.sample, fitter.settings.screen
    scans, firings = len(sample.names), int(sample.firing.max(initial=0)) + 1
    if firings < 4 * by.slowest or scans < 4:
        return
    signs = rng.choice((-1.0, 1.0), (by.wave_draws, scans))
    for channel in MEANS:
        if channel not in fitted.evidence.score:
            continue
        size = scale(fitted, channel)
        place = sample.frame * firings + sample.firing
        table = np.bincount(place, fitted.evidence.score[channel] * size, scans * firings).reshape(scans, firings)
        lines = np.fft.rfft(table, axis=1)[:, by.slowest :]
        own = (np.abs(lines) ** 2).sum(0)
        smooth = np.maximum(own, np.median(own))
        if not smooth.any():
            continue
        power = np.abs(lines.sum(0)) ** 2 / smooth
        drawn = (np.abs(signs @ lines) ** 2 / smooth).max(1)
        best = int(np.argmax(power))
        chance = (1 + np.count_nonzero(drawn >= power[best])) / (by.wave_draws + 1)
        if chance > fitter.settings.level / len(MEANS):
            continue
        waves = _refined(table.sum(0), best + by.slowest, by.wave_fine)
        turn = 2 * np.pi * waves / firings * sample.firing
        table = np.stack([np.cos(turn), np.sin(turn)], 1) * size[:, None]
        columns = sparse.csr_matrix(table)
        yield Group(
            f"{channel} by phase", channel, {channel: columns}, 2, ("phase",), label=f"{firings / waves:.6g}",
        )  # fmt: skip


def _refined(sums: np.ndarray, waves: int, values: int) -> float:
    """Waves a revolution where the periodogram of sums (firings,) is highest about a line."""
    fine = waves + np.linspace(-1, 1, values)
    turns = np.exp(-2j * np.pi * np.outer(fine, np.arange(len(sums))) / len(sums))
    return float(fine[np.argmax(np.abs(turns @ sums))])
