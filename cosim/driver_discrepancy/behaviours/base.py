"""Base class of behaviours in the loop: parameters, channels, and their place in a configuration."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.traffic.behaviour import BehaviourConfig
from cosim.traffic.behaviour.distributions import Choice, Constant, Normal, Uniform

Drawn = Constant | Uniform | Normal | Choice
Values = Mapping[str, float]
_ROOT3 = 3**0.5
_DRAWS = 2000


@dataclass(frozen=True)
class Knob:
    """One parameter.

    Attributes:
        name, unit: its key and unit.
        low, high: bounds.
        step: a change that shows in a minute of traffic.
        description: a sentence.
    """

    name: str
    unit: str
    low: float
    high: float
    step: float
    description: str


@dataclass(frozen=True)
class Background:
    """Means over the drivers' vehicle types, for what a configuration leaves to them.

    Attributes:
        sigma, accel_mps2, decel_mps2, min_gap_m, tau_s, startup_delay_s, time_gap_s: SUMO's parameters.
        speed_factor, speed_dev: mean and standard deviation between drivers [1].
        step_s: of the simulation, the time between decisions.
    """

    sigma: float = 0.5
    accel_mps2: float = 2.6
    decel_mps2: float = 4.5
    min_gap_m: float = 2.5
    tau_s: float = 1.0
    startup_delay_s: float = 0.0
    time_gap_s: float = 1.0
    speed_factor: float = 1.0
    speed_dev: float = 0.1
    step_s: float = 0.1


@dataclass(frozen=True)
class Signal:
    """Difference of one column: standardised, measured less modelled; and the ratio of measured to modelled."""

    channel: str
    condition: str
    level: str
    z: float
    ratio: float


Propose = Callable[[BehaviourConfig, Sequence[Signal]], BehaviourConfig | None]


@dataclass(frozen=True, eq=False)
class Behaviour:
    """A way to drive.

    Attributes:
        name: as in the catalogue.
        knobs: its parameters.
        statistics: channels that show it.
        equation: what it does, in a line.
        vtype: SUMO's words for it.
        confusable_with: behaviours with similar traces.
        read: current values in a configuration.
        write: the configuration with values.
        condition: condition whose columns show it besides the whole channels; empty without one.
        propose: the configuration from which its parameters can be fitted, chosen by the evidence; None: where the
            evidence speaks against it.
        is_incident: a rate in the whole town, seen in few vehicles.
    """

    name: str
    knobs: tuple[Knob, ...]
    statistics: tuple[str, ...]
    equation: str
    vtype: str
    confusable_with: tuple[str, ...]
    read: Callable[[BehaviourConfig, Background], dict[str, float]]
    write: Callable[[BehaviourConfig, Values], BehaviourConfig]
    condition: str = ""
    propose: Propose | None = None
    is_incident: bool = False

    def clipped(self, values: Values) -> dict[str, float]:
        """Values within their bounds."""
        return {knob.name: float(np.clip(values[knob.name], knob.low, knob.high)) for knob in self.knobs}

    def shows(self, channel: str, condition: str) -> bool:
        """Whether a column shows it."""
        return channel in self.statistics and condition in ("", self.condition)


def moments(drawn: Drawn | None) -> tuple[float, float]:
    """Mean and standard deviation of a distribution."""
    if isinstance(drawn, Uniform):
        return (drawn.min + drawn.max) / 2, (drawn.max - drawn.min) / (2 * _ROOT3)
    if drawn is None or isinstance(drawn, Constant):
        return (drawn.value if drawn else 0.0), 0.0
    rng = np.random.default_rng(0)
    values = np.array([drawn.draw(rng) for _ in range(_DRAWS)])
    return float(values.mean()), float(values.std())


def even(mean: float, deviation: float, low: float, high: float) -> Uniform:
    """The even distribution of a mean and a standard deviation; narrower near a bound, so that the mean remains."""
    middle = float(np.clip(mean, low, high))
    half = min(_ROOT3 * abs(deviation), middle - low, high - middle)
    return Uniform(min=round(middle - half, 6), max=round(middle + half, 6))


def with_common_luck(config: BehaviourConfig) -> BehaviourConfig:
    """Return the configuration with every constant as a distribution of zero width.

    A constant draws nothing, so that giving it a width would change all later draws of a driver.
    """
    changed = {}
    for name in type(config).model_fields:
        value = getattr(config, name)
        if isinstance(value, Constant):
            changed[name] = Uniform(min=value.value, max=value.value)
    return changed_in(config, **changed)


def changed_in(config: BehaviourConfig, **values: Any) -> BehaviourConfig:
    """The configuration with other values, validated."""
    return BehaviourConfig.model_validate({**config.model_dump(), **{k: _plain(v) for k, v in values.items()}})


def _plain(value: Any) -> Any:
    return value.model_dump() if hasattr(value, "model_dump") else value
