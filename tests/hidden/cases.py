"""The matrix of cases: what is hidden, how strongly, in which town."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tests.hidden import base_drives
from tests.hidden.amplitudes import STRENGTHS, has_level, parameters
from tests.hidden.drive import Hidden
from tests.hidden.nuisances import NUISANCES
from tests.hidden.unnamed import UNNAMED

GROUPS = ("null", "nuisance", "strong", "one", "half", "quarter", "several", "unnamed", "unnamed_half", "disturbed")
_KNOWN = {
    "dual_block": {"upper_m": 0.0405, "lower_m": -0.0405},
    "sweep_motion": {"sweep_s": 0.1},
    "glass_transmission": {"transmission": 0.85, "mode": "strongest"},
    "incidence_falloff": {"exponent": 0.5},
    "random_dropout": {"probability": 0.05},
}
_SEVERAL = (
    ("range_walk", "incidence_falloff"),
    ("elevation_offset", "range_bias"),
    ("sweep_motion", "ring_range_offset"),
    ("atmospheric_extinction", "random_dropout"),
    ("incidence_bias", "range_scale"),
    ("dual_block", "encoder_eccentricity"),
    ("ring_gain", "range_falloff"),
    ("suspension_pitch", "max_range"),
    ("range_walk", "elevation_offset", "backscatter"),
    ("mount_rotation", "ring_gain", "random_dropout"),
    ("sweep_motion", "glass_transmission", "range_bias"),
    ("range_noise", "incidence_falloff", "false_alarms"),
    ("incidence_bias", "detection_threshold", "ring_elevation"),
)
_DISTURBED = (
    ("range_walk", ("label_jitter_track", "pose_drift")),
    ("elevation_offset", ("pose_drift",)),
    ("incidence_bias", ("map_error",)),
    ("range_bias", ("label_jitter_frame", "heavy_tails")),
    ("ring_range_offset", ("outliers", "label_jitter_track")),
    ("incidence_falloff", ("label_jitter_track", "map_error")),
)
_QUICK = (
    "null-plain-0", "null-known-0", "nuisance-label_jitter_track-0", "nuisance-pose_drift-0", "strong-range_walk-0",
    "strong-elevation_offset-0", "strong-incidence_falloff-0", "strong-random_dropout-0", "half-range_walk-0",
    "half-range_bias-0", "several-range_walk+incidence_falloff-0", "several-sweep_motion+ring_range_offset-0",
    "unnamed-azimuth_step-0", "unnamed-dirty_window-0",
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """One drive to be diagnosed.

    Attributes:
        name: group, what is hidden, seed.
        group: of `GROUPS`.
        hidden: what is hidden.
        base, held_out: names of base drives: the one to be diagnosed, and one the diagnosis never sees.
    """

    name: str
    group: str
    hidden: Hidden
    base: str
    held_out: str

    @property
    def is_quick(self) -> bool:
        """Part of the quick matrix."""
        return self.name in _QUICK


def all_cases(seeds: int, frames: int) -> list[Case]:
    """Every case for seeds 0 … seeds − 1, in an order that shows something of every group early."""
    found = [case for seed in range(seeds) for case in _of_seed(seed, frames)]
    rank = {case.name: zlib.crc32(case.name.encode()) for case in found}
    return sorted(found, key=lambda case: (not case.is_quick, rank[case.name]))


def _of_seed(seed: int, frames: int) -> Iterator[Case]:
    def case(group: str, what: str, **hidden) -> Case:
        name = f"{group}-{what}-{seed}"
        code = zlib.crc32(name.encode())
        row = code % len(base_drives.NAMES)
        other = (row + 1 + code // 7 % 2) % len(base_drives.NAMES)
        base, held_out = base_drives.NAMES[row], base_drives.NAMES[other]
        return Case(name, group, Hidden(seed=code % 100_000, frames=frames, **hidden), base, held_out)

    def drawn(effects: tuple[str, ...], level: str, key: str) -> dict[str, dict]:
        rng = np.random.default_rng([seed, zlib.crc32(key.encode())])
        return {name: parameters(name, level, rng) for name in effects}

    yield case("null", "plain")
    yield case("null", "known", known=_KNOWN)
    yield case("null", "logistic", range_law="logistic", intensity_law="student5")
    yield case("null", "without_rays", rays=False)
    yield case("null", "foreign_materials", foreign=True)
    for nuisance in (*NUISANCES, "outliers", "heavy_tails"):
        yield case("nuisance", nuisance, nuisances=(nuisance,))
    for level in ("strong", "one", "half", "quarter"):
        for name in STRENGTHS:
            if has_level(name, level):
                yield case(level, name, effects=drawn((name,), level, name + level))
    for names in _SEVERAL:
        yield case("several", "+".join(names), effects=drawn(names, "strong", "+".join(names)))
    for name, unnamed in UNNAMED.items():
        yield case("unnamed", name, unnamed={name: dict(unnamed.strong)})
        yield case("unnamed_half", name, unnamed={name: dict(unnamed.half)})
    yield case(
        "strong", "elevation_offset_without_rays", effects=drawn(("elevation_offset",), "strong", "e"), rays=False
    )
    for name, nuisances in _DISTURBED:
        yield case("disturbed", name, effects=drawn((name,), "strong", name + "disturbed"), nuisances=nuisances)
