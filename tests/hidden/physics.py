"""All hidden effects in the order in which they act, whatever order a truth lists them in."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from tests.hidden import aiming, clutter, light, reading, surfaces
from tests.hidden.head import Aim, Beams
from tests.hidden.scan import Scan, bare_scan
from tests.hidden.truth import Told
from tests.hidden.twin_tracing import Surfaces, Twin
from tests.hidden.unknowns import KINDS, noise_law
from tests.hidden.unnamed import UNNAMED

RAYS = (
    "mount_rotation", "mount_translation", "elevation_offset", "ring_elevation", "encoder_eccentricity",
    "dual_block", "sweep_motion", "time_offset", "suspension_pitch",
)  # fmt: skip
SURFACE = ("beam_divergence", "wet_road", "glass_transmission", "mirror_ghost")
LIGHT = (
    "incidence_falloff", "range_falloff", "atmospheric_extinction", "focal_response", "ring_gain", "retroreflection",
)  # fmt: skip
DETECTION = ("detection_threshold", "random_dropout", "max_range")
BIAS = ("range_bias", "range_scale", "ring_range_offset", "range_walk", "incidence_bias")
NOISE = ("intensity_noise", "range_noise")
CLUTTER = ("backscatter", "false_alarms", "blooming")
ROUNDING = ("intensity_quantization", "range_quantization")
CATALOGUE = (*RAYS, *SURFACE, *LIGHT, *DETECTION, *BIAS, *NOISE, *CLUTTER, *ROUNDING)


@dataclass(frozen=True)
class Truth:
    """The sensor that nobody knows.

    Attributes:
        effects: catalogue effects and their parameters.
        unnamed: effects of `unnamed.py`, or kinds of `unknowns.py`, and their parameters.
        range_law, intensity_law: names of noise laws in `reading.LAWS`.
        outliers: share of returns whose range is off by up to a metre.
    """

    effects: Mapping[str, Mapping] = field(default_factory=dict)
    unnamed: Mapping[str, Mapping] = field(default_factory=dict)
    range_law: str = "gaussian"
    intensity_law: str = "gaussian"
    outliers: float = 0.0

    def __post_init__(self) -> None:
        strange = [*(set(self.effects) - set(CATALOGUE)), *(set(self.unnamed) - set(UNNAMED) - set(KINDS))]
        if strange:
            raise ValueError(f"no maker for {', '.join(strange)}")

    @property
    def bends_rays(self) -> bool:
        """True where rays are not the nominal ones."""
        return any(name in self.effects for name in RAYS)

    def noise(self, channel: str) -> Callable[[np.random.Generator, int], np.ndarray]:
        """The law of a channel's noise, standard deviation 1."""
        base = reading.LAWS[self.range_law if channel == "range" else self.intensity_law]
        shape = self.unnamed.get("noise_shape")
        return noise_law(shape, base) if shape is not None and shape["channel"] == channel else base


def told(name: str, parameters: Mapping) -> Told:
    """What a diagnosis should say of an unnamed effect."""
    return UNNAMED[name].told if name in UNNAMED else KINDS[name].told(parameters)


def true_aim(truth: Truth, beams: Beams, frame: dict) -> Aim:
    """Where the beams of a frame truly point."""
    aim = Aim.nominal(beams)
    for name in RAYS:
        if name in truth.effects:
            getattr(aiming, name)(aim, beams, frame, **truth.effects[name])
    return aim


def measure(
    truth: Truth,
    twin: Twin,
    frame: dict,
    beams: Beams,
    rng: np.random.Generator,
    elapsed_s: float = 0.0,
    known: tuple[Surfaces, Surfaces] | None = None,
) -> Scan:
    """One revolution of the true sensor."""
    scan = bare_scan(twin, frame, beams, true_aim(truth, beams, frame), elapsed_s, known)
    _act(scan, truth, surfaces, SURFACE, rng)
    _act(scan, truth, light, LIGHT, rng)
    _unnamed(scan, truth, "signal", rng)
    _act(scan, truth, light, DETECTION, rng)
    _unnamed(scan, truth, "detected", rng)
    scan.intensity = np.clip(scan.intensity, 0, 1)
    _act(scan, truth, reading, BIAS, rng)
    for name in NOISE:
        if name in truth.effects:
            # Errors of range that follow the measured intensity come between the two.
            law = truth.noise(name.removesuffix("_noise"))
            getattr(reading, name)(scan, lambda n, law=law: law(rng, n), **truth.effects[name])
        if name == "intensity_noise":
            scan.intensity = np.clip(scan.intensity, 0, 1)
            _unnamed(scan, truth, "range", rng)
    wild = rng.random(len(scan.found)) < truth.outliers
    scan.range_m[wild] += rng.uniform(-1, 1, wild.sum())
    _act(scan, truth, clutter, CLUTTER, rng)
    _act(scan, truth, reading, ROUNDING, rng)
    scan.intensity = np.clip(scan.intensity, 0, 1)
    return scan


def _act(scan: Scan, truth: Truth, module, names: tuple[str, ...], rng) -> None:
    for name in names:
        if name in truth.effects:
            getattr(module, name)(scan, rng, **truth.effects[name])


def _unnamed(scan: Scan, truth: Truth, stage: str, rng) -> None:
    for name, parameters in truth.unnamed.items():
        if _stage(name, parameters) != stage:
            continue
        if name in UNNAMED:
            UNNAMED[name].act(scan, rng, **parameters)
        else:
            KINDS[name].act(scan, rng, parameters)


def _stage(name: str, parameters: Mapping) -> str:
    """`signal` with the light, `detected` once it is known what returns, `range` once intensity is read."""
    if told(name, parameters).channels[0] == "range":
        return "range"
    return "detected" if name in KINDS and KINDS[name].late(parameters) else "signal"
