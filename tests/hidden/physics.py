"""All hidden effects in the order in which they act, whatever order a truth lists them in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from tests.hidden import aiming, clutter, light, reading, surfaces
from tests.hidden.head import Aim, Beams
from tests.hidden.scan import Scan, bare_scan
from tests.hidden.twin_tracing import Surfaces, Twin
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
        unnamed: effects of `unnamed.py` and their parameters.
        range_law, intensity_law: names of noise laws in `reading.LAWS`.
        outliers: share of returns whose range is off by up to a metre.
    """

    effects: Mapping[str, Mapping] = field(default_factory=dict)
    unnamed: Mapping[str, Mapping] = field(default_factory=dict)
    range_law: str = "laplace"
    intensity_law: str = "logistic"
    outliers: float = 0.0

    def __post_init__(self) -> None:
        strange = [*(set(self.effects) - set(CATALOGUE)), *(set(self.unnamed) - set(UNNAMED))]
        if strange:
            raise ValueError(f"no maker for {', '.join(strange)}")

    @property
    def bends_rays(self) -> bool:
        """True where rays are not the nominal ones."""
        return any(name in self.effects for name in RAYS)


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
    _unnamed(scan, truth, ("signal", "drop"), rng)
    _act(scan, truth, light, DETECTION, rng)
    scan.intensity = np.clip(scan.intensity, 0, 1)
    _act(scan, truth, reading, BIAS, rng)
    for name, law in (("intensity_noise", truth.intensity_law), ("range_noise", truth.range_law)):
        if name in truth.effects:
            # Errors of range that follow the measured intensity come between the two.
            getattr(reading, name)(scan, lambda n, law=law: reading.LAWS[law](rng, n), **truth.effects[name])
        if name == "intensity_noise":
            scan.intensity = np.clip(scan.intensity, 0, 1)
            _unnamed(scan, truth, ("range",), rng)
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


def _unnamed(scan: Scan, truth: Truth, kinds: tuple[str, ...], rng) -> None:
    for name, parameters in truth.unnamed.items():
        effect = UNNAMED[name]
        if effect.kind in kinds:
            effect.act(scan, rng, **parameters)
