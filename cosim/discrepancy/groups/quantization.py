"""Do measured values stand on a lattice? Ranges are counted in steps, intensities stored in few bits.

A lattice of step δ is a spectral line: the mean of cos(2π·value/δ) is 1 for values that are multiples of δ and near 0
for others (Bartlett, The spectral analysis of point processes, JRSS B 1963). Values crowd by themselves where surfaces
do, so a line counts only where the model's own values have none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.settings import DEFAULT
from sensors.effects.base import Effect, RoundingEffect

_CLEAR = 0.9  # mean cosine of values that count as multiples of a step
_CLEARER = 0.25  # share of the model's distance from a lattice that measured values may have
_FINEST = (1e-3, 2e-3)  # steps of range [m] and of intensity that are looked for
_COARSEST = (1.0, 0.5)
_MOST = (130.0, 1.0)
_STORED = (1e-5, 1e-6)  # to which values are written
_PADDED = 4
_FEWEST = 500


@dataclass(frozen=True, eq=False)
class Lattice:
    """A lattice that measurements stand on and the model does not.

    Attributes:
        effect: that makes it.
        step, standard_error: in the unit of its parameter.
        gain: (n,) log-likelihood that it adds to each beam.
        apart: (n,) cosine of the measured value's place between steps less that of the model's; 0 on average if neither
            is rounded.
    """

    effect: RoundingEffect
    step: float
    standard_error: float
    gain: np.ndarray
    apart: np.ndarray

    @property
    def interval(self) -> dict[str, list[float]]:
        """95 % interval by parameter."""
        reach = float(norm.ppf(DEFAULT.upper)) * self.standard_error
        return {name: [self.step - reach, self.step + reach] for name in type(self.effect).model_fields}


def find_lattices(
    fitter: Fitter, fitted: Fitted, kinds: Sequence[type[Effect]], rng: np.random.Generator
) -> list[Lattice]:
    """Lattices of ranges and intensities beyond those of the model.

    Args:
        fitter: of the sample.
        fitted: the model as it stands.
        kinds: the candidates; those that round are asked for.
        rng: for the model's chance.
    """
    sample, expected = fitter.sample, fitted.prediction
    pairs = (
        (sample.reported_range(fitted.effects), expected.range_m, expected.range_sigma_m),
        (sample.intensity, expected.intensity, expected.intensity_sigma),
    )
    weight, found = sample.share, []
    for kind in kinds:
        if not issubclass(kind, RoundingEffect):
            continue
        shown = kind.model_validate(kind.example)
        (name,) = kind.model_fields
        for quantity, (measured, mean, sigma) in enumerate(pairs):
            if not shown.steps[quantity]:
                continue
            foretold = mean + sigma * rng.standard_normal(len(mean))
            step = _step(measured, foretold, quantity)
            own = next((one.steps[quantity] for one in fitted.effects if one.name == kind.name), 0.0)  # type: ignore[attr-defined]
            if step is None or (own and step <= own * 1.01):
                continue
            found.append(_lattice(kind.model_validate({name: step}), step, measured, foretold, weight, quantity))
    return found


def _lattice(
    effect: RoundingEffect, step: float, measured: np.ndarray, foretold: np.ndarray, weight: np.ndarray, quantity: int
) -> Lattice:
    usable = _usable(measured, quantity)
    number = np.rint(np.where(usable, measured, 0.0) / step)
    rest = np.where(usable, measured - number * step, 0.0)
    scatter = max(float(np.sqrt(np.mean(rest[usable] ** 2))), _STORED[quantity])
    told = usable & np.isfinite(foretold)
    shown, own = (np.cos(2 * np.pi * np.where(told, values, 0) / step) for values in (measured, foretold))
    each = np.log(step / scatter) - 0.5 * np.log(2 * np.pi) - 0.5 * (rest / scatter) ** 2
    return Lattice(
        effect=effect,
        step=step,
        standard_error=scatter / max(float(np.sqrt((number[usable] ** 2).sum())), 1.0),
        gain=np.where(usable, weight * each, 0.0),
        apart=np.where(told, weight * (shown - own), 0.0),
    )


def _step(measured: np.ndarray, foretold: np.ndarray, quantity: int) -> float | None:
    """The largest step that measured values are multiples of, or None."""
    values = measured[_usable(measured, quantity)]
    if len(values) < _FEWEST:
        return None
    frequency, line = _spectrum(values, quantity)
    _, own = _spectrum(foretold[_usable(foretold, quantity)], quantity)
    peak = np.append(False, (line[1:-1] >= line[:-2]) & (line[1:-1] >= line[2:]))
    peak = np.append(peak, False) & (frequency >= 1 / _COARSEST[quantity])
    clear = np.flatnonzero(peak & (line > _CLEAR) & (1 - line < _CLEARER * (1 - own)))
    if not len(clear):
        return None
    step = 1 / float(frequency[clear[0]])
    for _ in range(3):
        number = np.rint(values / step)
        step = float((number * values).sum() / (number**2).sum())
    return step


def _usable(values: np.ndarray, quantity: int) -> np.ndarray:
    """Values that tell of a lattice: those cut off at the ends of their range stand on many."""
    with np.errstate(invalid="ignore"):
        return (values > _FINEST[quantity] / 2) & (values < _MOST[quantity])


def _spectrum(values: np.ndarray, quantity: int) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies, and the mean cosine of values at each."""
    width = _FINEST[quantity] / 8
    bins = int(np.ceil(_MOST[quantity] / width))
    count = np.bincount(np.rint(values / width).astype(int), minlength=bins + 1)
    line = np.fft.rfft(count, _PADDED * bins).real / max(len(values), 1)
    frequency = np.arange(len(line)) / (_PADDED * bins * width)
    wanted = frequency <= 1 / _FINEST[quantity]
    return frequency[wanted], line[wanted]
