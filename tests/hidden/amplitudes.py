"""How strong a hidden catalogue effect is: a share of the point noise, or plain to see.

One standard deviation of the point noise is 2 cm of range, 10 % of intensity; `one` gives each effect parameters that
move a typical return by about as much. Effects that lose or add returns have no such scale: there `one` is modest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

LEVELS = {"quarter": 0.25, "half": 0.5, "one": 1.0}


@dataclass(frozen=True)
class Strength:
    """Parameters of an effect by level.

    Attributes:
        one: amplitudes of about one standard deviation.
        strong: amplitudes plain to see.
        fixed: parameters that have no level.
        signed: whether the amplitude may be negative.
        base: added to amplitudes (a gain of 1 changes nothing).
        per_ring: name of a list parameter whose entries have that spread.
    """

    one: Mapping[str, float]
    strong: Mapping[str, float]
    fixed: Mapping[str, float | str] = field(default_factory=dict)
    signed: bool = False
    base: float = 0.0
    per_ring: bool = False


STRENGTHS: dict[str, Strength] = {
    "mount_rotation": Strength(
        {"roll_deg": 0.03, "pitch_deg": 0.02, "yaw_deg": 0.05}, {"roll_deg": 0.3, "pitch_deg": 0.2, "yaw_deg": 0.5},
        signed=True,
    ),
    "mount_translation": Strength(
        {"x_m": 0.01, "y_m": 0.01, "z_m": 0.005}, {"x_m": 0.1, "y_m": 0.08, "z_m": 0.06}, signed=True
    ),
    "elevation_offset": Strength({"offset_deg": 0.02}, {"offset_deg": 0.2}, signed=True),
    "ring_elevation": Strength({"offsets_deg": 0.03}, {"offsets_deg": 0.12}, per_ring=True),
    "encoder_eccentricity": Strength({"amplitude_deg": 0.1}, {"amplitude_deg": 0.4}, {"phase_deg": 50.0}),
    "dual_block": Strength(
        {"upper_m": 0.005, "lower_m": -0.005}, {"upper_m": 0.0405, "lower_m": -0.0405}
    ),
    "sweep_motion": Strength({}, {}, {"sweep_s": 0.1}),
    "time_offset": Strength({"delay_s": 0.003}, {"delay_s": 0.03}, signed=True),
    "suspension_pitch": Strength({"gain_deg_per_mps2": 0.03}, {"gain_deg_per_mps2": 0.3}),
    "beam_divergence": Strength({"divergence_mrad": 3.0}, {"divergence_mrad": 6.0}, {"pulse_ns": 6.0}),
    "wet_road": Strength({"film": 0.2}, {"film": 0.7}),
    "glass_transmission": Strength({}, {"transmission": -0.25}, {"mode": "strongest"}, base=1.0),
    "mirror_ghost": Strength({"strength": 0.2}, {"strength": 0.5}),
    "incidence_falloff": Strength({"exponent": 0.06}, {"exponent": 0.8}),
    "range_falloff": Strength({"exponent": 0.2}, {"exponent": 1.8}, {"reference_m": 25.0}),
    "atmospheric_extinction": Strength({"alpha_per_m": 0.0025}, {"alpha_per_m": 0.02}),
    "focal_response": Strength({"slope": 0.15}, {"slope": 0.8}, {"focal_distance_m": 14.0}),
    "ring_gain": Strength({"gains": 0.1}, {"gains": 0.25}, base=1.0, per_ring=True),
    "retroreflection": Strength({"gain": 0.1}, {"gain": 0.5}, base=1.0),
    "detection_threshold": Strength({"threshold": 0.08}, {"threshold": 0.17}, {"softness": 0.02}),
    "random_dropout": Strength({"probability": 0.02}, {"probability": 0.12}),
    "max_range": Strength({}, {"range_m": 30.0}),
    "range_bias": Strength({"offset_m": 0.02}, {"offset_m": 0.08}, signed=True),
    "range_scale": Strength({"scale_ppm": 1300.0}, {"scale_ppm": 6000.0}, signed=True),
    "ring_range_offset": Strength({"offsets_m": 0.02}, {"offsets_m": 0.06}, per_ring=True),
    "range_walk": Strength({"amplitude_m": 0.05}, {"amplitude_m": 0.15}, {"decay": 4.0}),
    "incidence_bias": Strength({"gain_m": 0.005}, {"gain_m": 0.02}),
    "intensity_noise": Strength({"sigma_rel": 0.05}, {"sigma_rel": 0.15}, base=0.1),
    "range_noise": Strength({"sigma_m": 0.01}, {"sigma_m": 0.02}, {"sigma_per_m": 0.0005}, base=0.02),
    "backscatter": Strength({"density_per_m": 0.002}, {"density_per_m": 0.01}, {"mean_range_m": 10.0}),
    "false_alarms": Strength(
        {"rate_per_frame": 60.0}, {"rate_per_frame": 300.0}, {"azimuth_deg": 40.0, "width_deg": 50.0}
    ),
    "blooming": Strength({"radius_deg": 0.5}, {"radius_deg": 1.0}, {"threshold": 0.7}),
    "intensity_quantization": Strength({"step": 0.05}, {"step": 0.1}),
    "range_quantization": Strength({"step_m": 0.06}, {"step_m": 0.15}),
}  # fmt: skip


def parameters(name: str, level: str, rng: np.random.Generator, rings: int = 64) -> dict:
    """Parameters of an effect at a level; amplitudes vary by ± 20 %, signs where they may.

    Args:
        name: of a catalogue effect.
        level: `quarter`, `half`, `one` or `strong`.
        rng: of the case.
        rings: length of parameters by ring.
    """
    strength = STRENGTHS[name]
    chosen, factor = (strength.strong, 1.0) if level == "strong" else (strength.one, LEVELS[level])
    drawn: dict = dict(strength.fixed)
    wobble = rng.uniform(0.8, 1.2)
    for key, amplitude in chosen.items():
        value = factor * wobble * amplitude
        if strength.per_ring:
            entries = np.clip(rng.normal(size=rings), -2, 2)
            drawn[key] = [round(float(strength.base + value * entry), 6) for entry in entries]
        else:
            sign = rng.choice([-1, 1]) if strength.signed else 1
            drawn[key] = round(float(strength.base + sign * value), 8)
    return drawn


def has_level(name: str, level: str) -> bool:
    """Whether the effect is made at this level."""
    return level == "strong" or bool(STRENGTHS[name].one)
