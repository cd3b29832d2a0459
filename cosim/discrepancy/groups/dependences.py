"""Dependences that ask what is off without an effect's name: on a covariate, a pair, a scan, a phase, or the noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy import sparse

from assets.materials import MATERIAL_NAMES
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.score import Quantity, SparseMatrix
from cosim.discrepancy.inference.score_test import Channel, Group
from cosim.discrepancy.sampling.gathering import BESIDE
from cosim.discrepancy.sampling.sample import Prediction, Sample

OF_SCANS = ("frame_time", "speed", "acceleration", "yaw_rate")


@dataclass(frozen=True, eq=False)
class Covariate:
    """One quantity of every beam of a sample.

    Attributes:
        name: as in `diagnose --json`.
        unit: of its values; empty for pure numbers and names.
        values: (n,) float; numbers of categories for names.
        bin: (n,) int; −1 where it is not known.
        centres: (b,) mean of each bin.
        names: (b,) of categories; empty for numbers.
        period: of angles that come round; 0 for others.
        of_scans: whether all beams of a scan have the same.
        of_neighbours: whether it was measured by other beams, whose noise it has.
    """

    name: str
    unit: str
    values: np.ndarray
    bin: np.ndarray
    centres: np.ndarray
    names: tuple[str, ...] = ()
    period: float = 0.0
    of_scans: bool = False
    of_neighbours: bool = False

    def basis(self, degree: int) -> np.ndarray:
        """(n, k) smooth functions without a mean: Legendre polynomials of ranks, or sines and cosines of angles."""
        known = np.isfinite(self.values)
        if self.period:
            turn = 2 * np.pi / self.period * np.nan_to_num(self.values)
            parts = [wave(k * turn) for k in range(1, degree // 2 + 2) for wave in (np.sin, np.cos)]
        else:
            order = np.searchsorted(np.sort(self.values[known]), np.nan_to_num(self.values))
            rank = 2 * (order + 0.5) / max(known.sum(), 1) - 1
            parts = [np.polynomial.legendre.Legendre.basis(k)(np.clip(rank, -1, 1)) for k in range(1, degree + 1)]
        return np.where(known[:, None], np.stack(parts, 1), 0.0)

    def binned(self, bins: int) -> Covariate:
        """The same in another number of bins; categories stay."""
        if self.names:
            return self
        found = _binned(self.name, self.unit, self.values, self.period, bins, 1)
        assert found is not None  # it has been binned before
        return replace(found, of_scans=self.of_scans, of_neighbours=self.of_neighbours)


def over_a_turn(name: str, values: np.ndarray, bins: int) -> Covariate:
    """A covariate that comes round: angles (n,) [rad] from −π to π."""
    found = _binned(name, "rad", values, 2 * np.pi, bins, 1)
    assert found is not None  # phases are many
    return found


def covariates(sample: Sample, expected: Prediction, bins: int) -> Iterator[Covariate]:
    """All that vary over a sample."""
    scan, by = sample.scan_values, sample.settings.screen
    resolved = {"speed": by.speed, "acceleration": by.acceleration, "yaw_rate": by.yaw_rate}
    nothing = sample.range_m * np.nan
    firing = np.where(np.isfinite(sample.range_m), sample.time_s, nothing)
    numbers = {
        "range": ("m", sample.range_m, 0.0),
        "incidence": ("°", np.degrees(np.arccos(np.clip(sample.cos_incidence, 0, 1))), 0.0),
        "elevation": ("°", sample.elevation_deg, 0.0),
        "azimuth": ("rad", sample.azimuth, 2 * np.pi),
        "firing_time": ("s", firing, 0.0),
        "frame_time": ("s", scan["time_s"][sample.frame], 0.0),
        "albedo": ("", sample.reflectance, 0.0),
        "intensity": ("", expected.intensity, 0.0),
        "speed": ("m/s", scan["speed_mps"][sample.frame], 0.0),
        "acceleration": ("m/s²", scan["acceleration_mps2"][sample.frame], 0.0),
        "yaw_rate": ("rad/s", scan["yaw_rate_radps"][sample.frame], 0.0),
    }
    if not sample.own_axes:  # of a world that scans share
        numbers |= {"world_x": ("m", sample.place[:, 0], 0.0), "world_y": ("m", sample.place[:, 1], 0.0)}
    beside = _of_neighbours(sample)
    for name in beside:
        values = sample.beside[name]
        numbers[name] = ("m" if name.endswith("_range") else "", values, 0.0)
    for name, (unit, values, period) in numbers.items():
        step = resolved.get(name, 0.0)
        told = np.asarray(values, float)
        found = _binned(name, unit, np.round(told / step) * step if step else told, period, bins, by.fewest_values)
        if found is not None:
            yield replace(found, of_scans=name in OF_SCANS, of_neighbours=name in BESIDE)
    groups = {
        "ring": (sample.ring, tuple(str(ring) for ring in range(int(sample.ring.max(initial=0)) + 1))),
        "block": (sample.block, ("upper", "lower")),
        "material": (np.where(sample.instance >= -1, sample.material, -1), MATERIAL_NAMES),
        "kind": (np.where(sample.kind > 0, sample.kind, -1), sample.kinds),
        "model": (np.where(sample.kind > 0, sample.model, -1), sample.models),
        **{name: (sample.beside[name].astype(int), ("seen", "lost")) for name in beside if name.endswith("_lost")},
    }
    for name, (codes, names) in groups.items():
        used = np.unique(codes[codes >= 0])
        if len(used) > (0 if name == "kind" else 1):
            place = np.full(int(used.max()) + 1, -1)
            place[used] = np.arange(len(used))
            row = np.where(codes >= 0, place[np.maximum(codes, 0)], -1)
            words = tuple(names[code] if code < len(names) else str(code) for code in used.tolist())
            yield Covariate(name, "", codes.astype(float), row, used.astype(float), words, of_neighbours=name in beside)


def _of_neighbours(sample: Sample) -> tuple[str, ...]:
    """Names of what neighbouring beams measured, as far as it tells of the sensor.

    Neighbours meet the same surfaces. Where the twin is not sure how far or how bright these are, what neighbours
    measured tells of that.
    """
    unsure_m, unsure_intensity = np.any(sample.unsure_m > 0), np.any(sample.unsure_intensity > 0)
    return tuple(name for name in BESIDE if not (unsure_intensity if name.endswith("_intensity") else unsure_m))


def _binned(name: str, unit: str, values: np.ndarray, period: float, bins: int, fewest: int) -> Covariate | None:
    known = np.isfinite(values)
    distinct = np.unique(values[known])
    if len(distinct) < fewest:
        return None
    if len(distinct) <= bins:
        edges = (distinct[1:] + distinct[:-1]) / 2
    elif period:
        edges = np.linspace(-period / 2, period / 2, bins + 1)[1:-1]
    else:
        edges = np.unique(np.quantile(values[known], np.linspace(0, 1, bins + 1)[1:-1]))
    row = np.where(known, np.searchsorted(edges, np.nan_to_num(values)), -1)
    count = np.bincount(row[known], minlength=len(edges) + 1)
    centres = np.bincount(row[known], values[known], len(edges) + 1) / np.maximum(count, 1)
    return Covariate(name, unit, values, row, centres, period=period)


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
    residuals, by = fitted.residuals, fitter.settings.screen
    of_channel: dict[Channel, tuple[np.ndarray, np.ndarray, np.ndarray, float]] = {
        "range": (residuals.range_z, residuals.matched > 0.9, residuals.range_sigma_m, by.least_noise_m),
        "intensity": (
            residuals.intensity_z,
            (residuals.bright > 0.9) & residuals.whole,
            residuals.intensity_sigma,
            by.least_noise,
        ),
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
