"""Measured curves: how one channel changes with one covariate or two, as the diagnosis fits it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sensors.effects.covariates import COVARIATES
from sensors.effects.shared_errors import UNITS

CHANNEL_UNITS = {
    "range": "m",
    "azimuth_error": "rad",
    "elevation_error": "rad",
    "intensity": "",
    "intensity_offset": "",
    "drop": "",
    "range_variance": "",
    "intensity_variance": "",
    "spurious": "",
    "early": "",
    "late": "",
    "shared_range": "m",
    "shared_azimuth_error": "rad",
    "shared_elevation_error": "rad",
    "shared_intensity": "",
    "shared_drop": "",
}
"""Unit of each channel's change.

`range` [m]; `azimuth_error`, `elevation_error`: true direction minus reported [rad]; `intensity`: ln of the factor;
`intensity_offset`; `drop`: relative change of the probability of a return; `range_variance`, `intensity_variance`:
change of ln σ of the sensor's noise; `spurious`, `early`, `late`: share of beams; `shared_…`: standard deviation.
"""

Axis = np.ndarray | tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Curve:
    """A measured dependence of one channel.

    Attributes:
        channel: a key of `CHANNEL_UNITS`.
        covariates: one name or two, see `sensors.effects.covariates`; of shared errors the unit that shares them; of a
            term that is periodic in absolute time `time`; of errors of objects `kind` and `object_size` or
            `object_place`, y along the three axes of the objects of each class [m].
        units: of the covariates; empty for pure numbers and categories.
        x: of each covariate (b,) centres of bins, or names of categories; `("cosine", "sine")` of a periodic term.
        y: (b,) or (b1, b2) change of the channel; NaN where it is not known.
        sigma: of the same shape, standard errors; infinite or NaN where `y` is not known.
        periods: of each covariate, 0 where it is not cyclic.
        frequency_hz: of a periodic term, amplitude·cos(2πft), amplitude·sin(2πft), t the pose time of the scan plus
            the firing time minus `start_s`; 0 for others.
        start_s: see `frequency_hz`.
        unit_size: firings of a packet, or sectors of a turn; of shared errors.
        p_value: family-wise.
    """

    channel: str
    covariates: tuple[str, ...]
    units: tuple[str, ...]
    x: tuple[Axis, ...]
    y: np.ndarray
    sigma: np.ndarray
    periods: tuple[float, ...] = ()
    frequency_hz: float = 0.0
    start_s: float = 0.0
    unit_size: int = 1
    p_value: float = 1.0

    def __post_init__(self) -> None:
        if self.channel not in CHANNEL_UNITS:
            raise ValueError(f"channel is {self.channel!r}; choose one of {', '.join(CHANNEL_UNITS)}")
        if not self.periods:
            object.__setattr__(self, "periods", (0.0,) * len(self.covariates))
        counts = {len(self.covariates), len(self.units), len(self.x), len(self.periods)}
        if counts not in ({1}, {2}):
            raise ValueError("covariates, units, x and periods have different lengths; give one or two of each")
        shape = tuple(len(axis) for axis in self.x)
        if self.y.shape != shape or self.sigma.shape != shape:
            raise ValueError(f"y has shape {self.y.shape} and sigma {self.sigma.shape}; give {shape}")
        names = UNITS if self.is_shared else tuple(COVARIATES)
        unknown = [name for name in self.covariates if name not in names]
        if unknown:
            raise ValueError(f"covariate {unknown[0]!r} of {self.channel} is unknown; choose one of {', '.join(names)}")
        if self.is_of_objects and (self.channel != "range" or self.covariates[0] != "kind" or shape[1] != 3):
            raise ValueError(
                f"{self.covariates[1]} is given for {self.channel} by {self.covariates[0]}; give it for range by kind"
            )
        if not self.is_known.any():
            raise ValueError("no value of y is known; give at least one with a finite standard error")

    @property
    def is_shared(self) -> bool:
        """Whether it is the standard deviation of an error that the beams of a unit share."""
        return self.channel.startswith("shared_")

    @property
    def is_of_objects(self) -> bool:
        """Whether it is an error of size or place that objects of a class have in common."""
        return len(self.covariates) == 2 and self.covariates[1] in ("object_size", "object_place")

    @property
    def is_known(self) -> np.ndarray:
        """(b,) or (b1, b2) bool: cells with a value and a standard error."""
        return np.isfinite(self.y) & np.isfinite(self.sigma)

    @property
    def unit(self) -> str:
        """Unit of y."""
        return CHANNEL_UNITS[self.channel]

    @property
    def name(self) -> str:
        """Name of its effect in sensor files."""
        on = [name for name in self.covariates if name != "constant"]
        return f"unknown_{self.channel}" + (f"_by_{'_and_'.join(on)}" if on else "")
