"""Hidden effects that no catalogue entry describes: a channel, the covariate that rules it, and a shape."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from tests.hidden.columns import made_of, measured_intensity, neighbour
from tests.hidden.scan import Scan
from tests.hidden.truth import Told

Shape = Callable[..., np.ndarray]


@dataclass(frozen=True)
class Unnamed:
    """An effect without a name.

    Attributes:
        kind: where it acts: `range` adds metres, `signal` multiplies intensity, `drop` is a probability of loss.
        covariate: the scan's column that it depends on.
        shape: covariate, parameters → metres, factor or probability.
        half, strong: parameters for half a standard deviation of the noise, and for a plain case.
        accepted: names of covariates that say the same.
    """

    kind: str
    covariate: str
    shape: Shape
    half: Mapping[str, float]
    strong: Mapping[str, float]
    accepted: tuple[str, ...] = field(default=())

    @property
    def channel(self) -> str:
        """As `diagnose` names it."""
        return "intensity" if self.kind == "signal" else self.kind

    @property
    def told(self) -> Told:
        """What a diagnosis should say."""
        return Told((self.channel,), (self.accepted or (self.covariate,),))

    def act(self, scan: Scan, rng: np.random.Generator, **parameters) -> None:
        """Change the scan."""
        value = self.shape(COVARIATES[self.covariate](scan), **parameters)
        if self.kind == "range":
            scan.range_m += value
        elif self.kind == "signal":
            scan.intensity *= value
        else:
            scan.found &= rng.random(len(scan.found)) >= value


COVARIATES: dict[str, Callable[[Scan], np.ndarray]] = {
    "azimuth": lambda scan: scan.beams.azimuth,
    "frame_time": lambda scan: np.full(len(scan.found), scan.elapsed_s),
    "previous_intensity": lambda scan: neighbour(scan, measured_intensity(scan), "previous", 0.0),
    "material": lambda scan: made_of(scan, ("paving",)).astype(float),  # stands for one odd surface
    "albedo": lambda scan: scan.table.albedo[scan.material],
    "range": lambda scan: scan.range_m,
    "incidence": lambda scan: np.arccos(np.clip(scan.cos, 0, 1)),
    "speed": lambda scan: np.full(len(scan.found), np.linalg.norm(scan.frame["ego"]["velocity_mps"])),
}
_TURNING = ("azimuth", "firing_time")  # the head turns evenly: one tells the other


def _bell(x, centre, width):
    return np.exp(-(((x - centre) / width) ** 2))


UNNAMED: dict[str, Unnamed] = {
    "azimuth_step": Unnamed(
        "range", "azimuth", lambda x, a_m: np.where(x > 0.6, a_m, 0.0), {"a_m": 0.010}, {"a_m": 0.05}, _TURNING
    ),
    "azimuth_double": Unnamed(
        "range", "azimuth", lambda x, a_m: a_m * np.sin(2 * x + 0.5), {"a_m": 0.014}, {"a_m": 0.05}, _TURNING
    ),
    "azimuth_sawtooth": Unnamed(
        "range", "azimuth", lambda x, a_m: a_m * (np.mod(x / (2 * np.pi) * 3, 1) - 0.5), {"a_m": 0.035},
        {"a_m": 0.12}, _TURNING,
    ),
    "warm_up": Unnamed(
        "range", "frame_time", lambda x, a_m, tau_s: a_m * (1 - np.exp(-x / tau_s)),
        {"a_m": 0.015, "tau_s": 8.0}, {"a_m": 0.08, "tau_s": 8.0},
    ),
    "slow_drift": Unnamed(
        "range", "frame_time", lambda x, a_mps: a_mps * x, {"a_mps": 0.0010}, {"a_mps": 0.004},
    ),
    "recovery": Unnamed(
        "range", "previous_intensity", lambda x, a_m: -a_m * x**2, {"a_m": 0.06}, {"a_m": 0.25}
    ),
    "odd_material": Unnamed(
        "range", "material", lambda x, a_m: a_m * x, {"a_m": 0.010}, {"a_m": 0.05}, ("material",)
    ),
    "albedo_step": Unnamed(
        "range", "albedo", lambda x, a_m: np.where((x > 0.14) & (x < 0.25), a_m, 0.0), {"a_m": 0.010}, {"a_m": 0.05},
        ("albedo", "material"),
    ),
    "far_hinge": Unnamed(
        "range", "range", lambda x, a: a * np.maximum(x - 25, 0), {"a": 0.0010}, {"a": 0.006}
    ),
    "dirty_window": Unnamed(
        "signal", "azimuth", lambda x, a: 1 - a * _bell(x, -0.8, 0.4), {"a": 0.10}, {"a": 0.5}, _TURNING
    ),
    "laser_ageing": Unnamed(
        "signal", "frame_time", lambda x, a_per_s: np.maximum(1 - a_per_s * x, 0.1), {"a_per_s": 0.0035},
        {"a_per_s": 0.012},
    ),
    "specular_lobe": Unnamed(
        "signal", "incidence", lambda x, a: 1 + a * _bell(x, 0.0, 0.2), {"a": 0.15}, {"a": 0.6}
    ),
    "sector_loss": Unnamed(
        "drop", "azimuth", lambda x, p: np.where((x > 0.9) & (x < 1.7), p, 0.0), {"p": 0.04}, {"p": 0.3}, _TURNING
    ),
    "speed_loss": Unnamed(
        "drop", "speed", lambda x, p_per_mps: np.clip(p_per_mps * x, 0, 1), {"p_per_mps": 0.003}, {"p_per_mps": 0.015}
    ),
}  # fmt: skip
