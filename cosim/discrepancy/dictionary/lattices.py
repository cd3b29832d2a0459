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
from cosim.discrepancy.settings import DEFAULT, Quantization, Settings
from sensors.effects.base import Effect, RoundingEffect


@dataclass(frozen=True, eq=False)
class Lattice:
    """A lattice that measurements stand on and the model does not.

    Attributes:
        effect: that makes it.
        interval: 95 % interval by parameter.
        gain: (n,) log-likelihood that it adds to each beam.
    """

    effect: RoundingEffect
    interval: dict[str, list[float]]
    gain: np.ndarray


def find_lattices(
    fitter: Fitter, fitted: Fitted, kinds: Sequence[type[Effect]], rng: np.random.Generator
) -> list[Lattice]:
    """Quantization of ranges and intensities beyond those of the model.

    Args:
        fitter: of the sample.
        fitted: the model as it stands.
        kinds: the candidates; those that round are asked for.
        rng: for the model's chance.
    """
    sample, expected, settings = fitter.sample, fitted.prediction, fitter.settings
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
            step = _step(measured, foretold, quantity, settings.quantization)
            own = next((one.steps[quantity] for one in fitted.effects if one.name == kind.name), 0.0)  # type: ignore[attr-defined]
            if step is None or (own and step <= own * 1.01):
                continue
            found.append(_lattice(kind.model_validate({name: step}), step, measured, weight, quantity, settings))
    return found


def _lattice(
    effect: RoundingEffect, step: float, measured: np.ndarray, weight: np.ndarray, quantity: int, settings: Settings
) -> Lattice:
    usable = _usable(measured, quantity, settings.quantization)
    number = np.rint(np.where(usable, measured, 0.0) / step)
    rest = np.where(usable, measured - number * step, 0.0)
    scatter = max(float(np.sqrt(np.mean(rest[usable] ** 2))), settings.quantization.stored[quantity])
    each = np.log(step / scatter) - 0.5 * np.log(2 * np.pi) - 0.5 * (rest / scatter) ** 2
    error = scatter / max(float(np.sqrt((number[usable] ** 2).sum())), 1.0)
    reach = float(norm.ppf(settings.upper)) * error
    interval = {name: [step - reach, step + reach] for name in type(effect).model_fields}
    return Lattice(effect, interval, gain=np.where(usable, weight * each, 0.0))


def _step(
    measured: np.ndarray, foretold: np.ndarray, quantity: int, by: Quantization = DEFAULT.quantization
) -> float | None:
    """The largest step that measured values are multiples of, or None."""
    values = measured[_usable(measured, quantity, by)]
    if len(values) < by.fewest:
        return None
    frequency, line = _spectrum(values, quantity, by)
    _, own = _spectrum(foretold[_usable(foretold, quantity, by)], quantity, by)
    peak = np.append(False, (line[1:-1] >= line[:-2]) & (line[1:-1] >= line[2:]))
    peak = np.append(peak, False) & (frequency >= 1 / by.coarsest[quantity])
    clear = np.flatnonzero(peak & (line > by.clear) & (1 - line + by.stored[quantity] < by.clearer * (1 - own)))
    if not len(clear):
        return None
    step = 1 / float(frequency[clear[0]])
    for _ in range(3):
        number = np.rint(values / step)
        step = float((number * values).sum() / (number**2).sum())
    return step


def _usable(values: np.ndarray, quantity: int, by: Quantization) -> np.ndarray:
    """Values that tell of a lattice: those cut off at the ends of their range stand on many."""
    with np.errstate(invalid="ignore"):
        return (values > by.finest[quantity] / 2) & (values < by.most[quantity])


def _spectrum(values: np.ndarray, quantity: int, by: Quantization) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies, and the mean cosine of values at each."""
    width = by.finest[quantity] / 8
    bins = int(np.ceil(by.most[quantity] / width))
    count = np.bincount(np.rint(values / width).astype(int), minlength=bins + 1)
    line = np.fft.rfft(count, by.padded * bins).real / max(len(values), 1)
    frequency = np.arange(len(line)) / (by.padded * bins * width)
    wanted = frequency <= 1 / by.finest[quantity]
    return frequency[wanted], line[wanted]
