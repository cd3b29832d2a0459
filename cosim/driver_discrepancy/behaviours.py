"""The driver behaviours that a diagnosis asks for: their parameters, and how a configuration says them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.driver_discrepancy.settings import DEFAULT
from cosim.traffic.behaviour import BehaviourConfig
from cosim.traffic.behaviour.distributions import Choice, Constant, Normal, Uniform

_BY = DEFAULT.placing
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
    """What a configuration leaves to the town.

    Attributes:
        sigma: imperfection of its vehicle types.
        step_s: of the simulation, the time between decisions.
    """

    sigma: float
    step_s: float


@dataclass(frozen=True, eq=False)
class Behaviour:
    """A way to drive.

    Attributes:
        name: as in the catalogue.
        knobs: its parameters.
        statistics: what shows it.
        equation: what it does, in a line.
        vtype: SUMO's words for it.
        confusable_with: behaviours whose traces look alike.
        read: current values in a configuration.
        write: the configuration with values.
    """

    name: str
    knobs: tuple[Knob, ...]
    statistics: tuple[str, ...]
    equation: str
    vtype: str
    confusable_with: tuple[str, ...]
    read: Callable[[BehaviourConfig, Background], dict[str, float]]
    write: Callable[[BehaviourConfig, Values], BehaviourConfig]

    def clipped(self, values: Values) -> dict[str, float]:
        """Values within their bounds."""
        return {knob.name: float(np.clip(values[knob.name], knob.low, knob.high)) for knob in self.knobs}


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
    """The even distribution of a mean and a standard deviation, within bounds."""
    half = _ROOT3 * abs(deviation)
    middle = float(np.clip(mean, low, high))
    return Uniform(min=round(max(middle - half, low), 6), max=round(min(middle + half, high), 6))


def with_common_luck(config: BehaviourConfig) -> BehaviourConfig:
    """The same configuration with every constant as a distribution of no width.

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


def _read_speeding(config: BehaviourConfig, _: Background) -> dict[str, float]:
    (share, one), (over, other) = moments(config.speeding_share), moments(config.speeding_kmh)
    mean = 1 + share + over / 3.6 / _BY.usual_limit_mps
    return {"speed_factor": mean, "speed_dev": float(np.hypot(one, other / 3.6 / _BY.usual_limit_mps))}


def _write_speeding(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    share = even(values["speed_factor"] - 1, values["speed_dev"], -0.5, 1.0)
    return changed_in(config, speeding_share=share, speeding_kmh=Uniform(min=0, max=0))


def _read_gap(config: BehaviourConfig, _: Background) -> dict[str, float]:
    return {"min_gap_m": moments(config.gap_m)[0], "tau_s": moments(config.headway_s)[0]}


def _write_gap(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    (gap, gap_dev), (tau, tau_dev) = moments(config.gap_m), moments(config.headway_s)
    gap_dev *= min(values["min_gap_m"] / max(gap, 0.1), 2.0)
    tau_dev *= min(values["tau_s"] / max(tau, 0.1), 2.0)
    return changed_in(
        config,
        gap_m=even(values["min_gap_m"], gap_dev, 0.05, 20),
        headway_s=even(values["tau_s"], tau_dev, 0.3, 5),
    )


def _read_offset(config: BehaviourConfig, _: Background) -> dict[str, float]:
    mean, deviation = moments(config.lane_offset_m)
    return {"lat_alignment_m": mean, "lat_dev_m": deviation}


def _write_offset(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    return changed_in(config, lane_offset_m=even(values["lat_alignment_m"], values["lat_dev_m"], -0.3, 0.3))


def _read_sigma(config: BehaviourConfig, town: Background) -> dict[str, float]:
    return {"sigma": town.sigma if config.imperfection is None else moments(config.imperfection)[0]}


def _read_reaction(config: BehaviourConfig, town: Background) -> dict[str, float]:
    return {"action_step_s": town.step_s if config.reaction_time_s is None else moments(config.reaction_time_s)[0]}


BEHAVIOURS: dict[str, Behaviour] = {
    one.name: one
    for one in (
        Behaviour(
            "speeding",
            (
                Knob("speed_factor", "", 0.6, 1.9, 0.15, "mean share of the limit that drivers want to go"),
                Knob("speed_dev", "", 0.0, 0.4, 0.06, "its standard deviation between drivers"),
            ),
            ("free_speed", "free_speed_spread"),
            "v_free = f·limit, f differs between drivers",
            "speedFactor, speedDev",
            (),
            _read_speeding,
            _write_speeding,
        ),
        Behaviour(
            "short_gap",
            (
                Knob("min_gap_m", "m", 0.1, 8.0, -0.8, "mean gap to the leader when standing"),
                Knob("tau_s", "s", 0.35, 4.0, -0.3, "mean headway to the leader when driving"),
            ),
            ("standing_gap", "headway"),
            "gap = min_gap + tau·v",
            "minGap, tau",
            ("reaction_time",),
            _read_gap,
            _write_gap,
        ),
        Behaviour(
            "lane_offset",
            (
                Knob("lat_alignment_m", "m", -0.3, 0.3, 0.15, "mean place beside the lane's middle, to the left"),
                Knob("lat_dev_m", "m", 0.0, 0.18, 0.08, "its standard deviation between drivers"),
            ),
            ("lateral", "lateral_spread"),
            "y = offset, constant for a driver",
            "latAlignment",
            (),
            _read_offset,
            _write_offset,
        ),
        Behaviour(
            "lane_changing",
            (Knob("share", "", 0.0, 1.0, 0.35, "chance of a change to a side, a stretch of road with a lane there"),),
            ("lane_changes",),
            "changes of lane for no reason, with a chance a road",
            "changeLane; lcSpeedGain, lcSigma",
            (),
            lambda config, _: {"share": moments(config.lane_change_share)[0]},
            lambda config, values: changed_in(config, lane_change_share=even(values["share"], 0, 0, 1)),
        ),
        Behaviour(
            "u_turns",
            (Knob("per_min", "1/min", 0.0, 60.0, 4.0, "U-turns begun in the town a minute"),),
            ("u_turns",),
            "a driver turns round where he could have gone on",
            "changeTarget to the reverse edge",
            (),
            lambda config, _: {"per_min": config.u_turns_per_min},
            lambda config, values: changed_in(config, u_turns_per_min=values["per_min"]),
        ),
        Behaviour(
            "parked_pull_out",
            (Knob("per_min", "1/min", 0.0, 60.0, 4.0, "parked vehicles that drive off in the town a minute"),),
            ("pull_outs",),
            "a parked vehicle leaves the kerb",
            "stop parkingArea, resume",
            (),
            lambda config, _: {"per_min": config.pull_outs_per_min},
            lambda config, values: changed_in(config, pull_outs_per_min=values["per_min"]),
        ),
        Behaviour(
            "imperfection",
            (Knob("sigma", "", 0.0, 1.0, 0.3, "how unsteadily drivers keep their speed"),),
            ("acceleration_noise",),
            "v − sigma·accel·dt·U(0,1) in every step (Krauß)",
            "sigma",
            ("reaction_time",),
            _read_sigma,
            lambda config, values: changed_in(config, imperfection=even(values["sigma"], 0, 0, 1)),
        ),
        Behaviour(
            "reaction_time",
            (Knob("action_step_s", "s", 0.0, 3.0, 0.6, "time between two of a driver's decisions"),),
            ("acceleration_memory", "reaction_lag", "startup_lag"),
            "decisions every action_step, the acceleration constant between",
            "actionStepLength",
            ("short_gap", "imperfection"),
            _read_reaction,
            lambda config, values: changed_in(config, reaction_time_s=even(values["action_step_s"], 0, 0, 3)),
        ),
    )
}

TOGETHER = (
    (("speeding", "speed_factor"), ("lane_offset", "lat_alignment_m"), ("parked_pull_out", "per_min")),
    (("speeding", "speed_dev"), ("lane_offset", "lat_dev_m"), ("lane_changing", "share")),
    (("short_gap", "min_gap_m"), ("u_turns", "per_min")),
    (("short_gap", "tau_s"), ("imperfection", "sigma")),
    (("reaction_time", "action_step_s"),),
)
"""Parameters that leave the statistics of each other alone, so that one simulation tells about all of a group."""
