"""Detection of rounding: ranges in multiples of a step, intensities with few bits.

Rounding to a step δ is a spectral line: the mean of cos(2π·value/δ) is 1 for multiples of δ and near 0 for other values
(Bartlett, The spectral analysis of point processes, JRSS B 25, 1963). Values also cluster because of the scene, so a
line counts only if the values predicted by the model do not have it.
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
    """A rounding step that measurements have and the model does not.

    Attributes:
        effect: rounding effect with this step.
        interval: 95 % interval by parameter.
        gain: (n,) gain in log-likelihood of each beam.
    """

    effect: RoundingEffect
    interval: dict[str, list[float]]
    gain: np.ndarray


def find_lattices(
    fitter: Fitter, fitted: Fitted, types: Sequence[type[Effect]], rng: np.random.Generator
) -> list[Lattice]:
    """Find rounding of ranges and intensities that is coarser than in the model.

    Args:
        fitter: fitter of the sample.
        fitted: current fit of the model.
        types: candidate effects; only rounding effects are tested.
        rng: random generator for sampling the model's noise.
    """
    sample, expected, settings = fitter.sample, fitted.prediction, fitter.settings
    pairs = (
        (sample.reported_range(fitted.effects), expected.range_m, expected.range_sigma_m),
        (sample.intensity, expected.intensity, expected.intensity_sigma),
    )
    weight, lattices = sample.share, []
    for kind in types:
        if not issubclass(kind, RoundingEffect):
            continue
        example = kind.model_validate(kind.example)
        (name,) = kind.model_fields
        for quantity, (measured, mean, sigma) in enumerate(pairs):
            if not example.steps[quantity]:
                continue
            predicted = mean + sigma * rng.standard_normal(len(mean))
            step = _find_step(measured, predicted, quantity, settings.quantization)
            own = next((effect.steps[quantity] for effect in fitted.effects if effect.name == kind.name), 0.0)  # type: ignore[attr-defined]
            if step is None or (own and step <= own * 1.01):
                continue
            lattices.append(_lattice(kind.model_validate({name: step}), step, measured, weight, quantity, settings))
    return lattices


def _lattice(
    effect: RoundingEffect, step: float, measured: np.ndarray, weight: np.ndarray, quantity: int, settings: Settings
) -> Lattice:
    usable = _is_usable(measured, quantity, settings.quantization)
    number = np.rint(np.where(usable, measured, 0.0) / step)
    residual = np.where(usable, measured - number * step, 0.0)
    scatter = max(float(np.sqrt(np.mean(residual[usable] ** 2))), settings.quantization.stored[quantity])
    gain = np.log(step / scatter) - 0.5 * np.log(2 * np.pi) - 0.5 * (residual / scatter) ** 2
    error = scatter / max(float(np.sqrt((number[usable] ** 2).sum())), 1.0)
    half_width = float(norm.ppf(settings.upper)) * error
    interval = {name: [step - half_width, step + half_width] for name in type(effect).model_fields}
    return Lattice(effect, interval, gain=np.where(usable, weight * gain, 0.0))


def _find_step(
    measured: np.ndarray, predicted: np.ndarray, quantity: int, by: Quantization = DEFAULT.quantization
) -> float | None:
    """Return the largest step that the measured values are multiples of, or None."""
    values = measured[_is_usable(measured, quantity, by)]
    if len(values) < by.fewest:
        return None
    frequency, line = _spectrum(values, quantity, by)
    _, predicted_line = _spectrum(predicted[_is_usable(predicted, quantity, by)], quantity, by)
    peak = np.append(False, (line[1:-1] >= line[:-2]) & (line[1:-1] >= line[2:]))
    peak = np.append(peak, False) & (frequency >= 1 / by.coarsest[quantity])
    clear = np.flatnonzero(
        peak & (line > by.clear) & (1 - line + by.stored[quantity] < by.clearer * (1 - predicted_line))
    )
    if not len(clear):
        return None
    step = 1 / float(frequency[clear[0]])
    for _ in range(3):
        number = np.rint(values / step)
        step = float((number * values).sum() / (number**2).sum())
    return step


def _is_usable(values: np.ndarray, quantity: int, by: Quantization) -> np.ndarray:
    """Mask (n,) of values that are informative about rounding; censored values are not."""
    with np.errstate(invalid="ignore"):
        return (values > by.finest[quantity] / 2) & (values < by.most[quantity])


def _spectrum(values: np.ndarray, quantity: int, by: Quantization) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (f,) [1/unit], and the mean cosine (f,) of the values at each."""
    width = by.finest[quantity] / 8
    bins = int(np.ceil(by.most[quantity] / width))
    count = np.bincount(np.rint(values / width).astype(int), minlength=bins + 1)
    line = np.fft.rfft(count, by.padded * bins).real / max(len(values), 1)
    frequency = np.arange(len(line)) / (by.padded * bins * width)
    wanted = frequency <= 1 / by.finest[quantity]
    return frequency[wanted], line[wanted]
