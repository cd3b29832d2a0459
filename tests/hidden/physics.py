"""All hidden effects in the order in which they act, whatever order a truth lists them in."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from tests.hidden import aiming, clutter, light, reading, surfaces
from tests.hidden.head import Aim, Beams
from tests.hidden.scan import Scan, bare_scan
from tests.hidden.twin_tracing import Surfaces, Twin
from tests.hidden.unseen.registry import KINDS

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
    """The true sensor.

    Attributes:
        effects: catalogue effects and their parameters.
        unseen: kinds of `unseen.registry.KINDS` and their parameters.
        range_law, intensity_law: names of noise distributions in `reading.LAWS`.
        outliers: share of returns with a range error of up to a metre.
    """

    effects: Mapping[str, Mapping] = field(default_factory=dict)
    unseen: Mapping[str, Mapping] = field(default_factory=dict)
    range_law: str = "gaussian"
    intensity_law: str = "gaussian"
    outliers: float = 0.0

    def __post_init__(self) -> None:
        strange = [*(set(self.effects) - set(CATALOGUE)), *(set(self.unseen) - set(KINDS))]
        if strange:
            raise ValueError(f"no maker for {', '.join(strange)}")

    def at(self, stage: str) -> list[tuple[str, Mapping]]:
        """Unseen effects that act at a stage."""
        return [(name, p) for name, p in self.unseen.items() if KINDS[name].stage(p) == stage]

    @property
    def bends_at_random(self) -> bool:
        """Whether no two revolutions have the same rays."""
        return any(KINDS[name].is_random(p) for name, p in self.at("aim"))

    def noise(self, channel: str) -> Callable[[np.random.Generator, int], np.ndarray]:
        """The distribution of a channel's noise, standard deviation 1."""
        base = reading.LAWS[self.range_law if channel == "range" else self.intensity_law]
        for name, p in self.at("law"):
            if p["channel"] == channel:
                base = KINDS[name].act(p, base)
        return base


def true_aim(
    truth: Truth,
    beams: Beams,
    frame: dict,
    rng: np.random.Generator | None = None,
    distances: Callable[[], np.ndarray] | None = None,
) -> Aim:
    """Where the beams of a frame truly point.

    Args:
        truth: the true sensor.
        beams: nominal beams.
        frame: the frame's JSON.
        rng: for errors that are random.
        distances: gives the (n,) distances of what nominal beams meet, for errors that depend on them.
    """
    aim = Aim.nominal(beams)
    for name in RAYS:
        if name in truth.effects:
            getattr(aiming, name)(aim, beams, frame, **truth.effects[name])
    unseen = truth.at("aim")
    if unseen:
        met = np.full(len(beams.ring), np.inf) if distances is None else distances()
        for name, p in unseen:
            KINDS[name].act(aim, beams, frame, met, rng, p)
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
    """One revolution of the true sensor; `known` are the surfaces of an earlier trace of the same rays."""

    def nominal_distances() -> np.ndarray:
        aim = Aim.nominal(beams)
        return twin.cast(frame, *aim.rays(frame), aim.after, beams.range_m)[0].distance.astype(float)

    aim = true_aim(truth, beams, frame, rng, nominal_distances)
    scan = bare_scan(twin, frame, beams, aim, elapsed_s, known)
    _act(scan, truth, surfaces, SURFACE, rng)
    _act(scan, truth, light, LIGHT, rng)
    _unseen(scan, truth, "signal", rng)
    _act(scan, truth, light, DETECTION, rng)
    _unseen(scan, truth, "detected", rng)
    scan.intensity = np.clip(scan.intensity, 0, 1)
    _act(scan, truth, reading, BIAS, rng)
    for name in NOISE:
        channel = name.removesuffix("_noise")
        if name in truth.effects:
            distribution, factor = truth.noise(channel), np.ones(len(scan.found))
            for kind, p in truth.at("spread"):
                factor = factor * KINDS[kind].act(scan, channel, p)
            getattr(reading, name)(scan, lambda n, d=distribution, f=factor: d(rng, n) * f, **truth.effects[name])
        if name == "intensity_noise":  # errors of range that follow the measured intensity come between the two
            scan.intensity = np.clip(scan.intensity, 0, 1)
            _unseen(scan, truth, "range", rng)
    wild = rng.random(len(scan.found)) < truth.outliers
    scan.range_m[wild] += rng.uniform(-1, 1, wild.sum())
    _act(scan, truth, clutter, CLUTTER, rng)
    _unseen(scan, truth, "clutter", rng)
    _act(scan, truth, reading, ROUNDING, rng)
    scan.intensity = np.clip(scan.intensity, 0, 1)
    _unseen(scan, truth, "reported", rng)
    return scan


def _act(scan: Scan, truth: Truth, module, names: tuple[str, ...], rng) -> None:
    for name in names:
        if name in truth.effects:
            getattr(module, name)(scan, rng, **truth.effects[name])


def _unseen(scan: Scan, truth: Truth, stage: str, rng) -> None:
    for name, p in truth.at(stage):
        KINDS[name].act(scan, rng, p)
