"""Configuration of driver behaviour: distributions of parameters and rates of incidents."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from cosim.traffic.behaviour.distributions import Choice, Constant, Distribution, Normal, Uniform, within
from cosim.traffic.street_speed import StreetSpeed

Rate = Annotated[float, Field(ge=0, le=600, allow_inf_nan=False)]

# What a preset says where it differs from the defaults, which are the paper's.
_PRESETS: dict[str, dict[str, Any]] = {
    "paper": {},
    "reference": {
        "speeding_share": {"kind": "uniform", "min": 0.0, "max": 0.3},
        "speeding_kmh": {"kind": "constant", "value": 0.0},
        "lane_change_share": {"kind": "uniform", "min": 0.0, "max": 0.8},
        "u_turns_per_min": 0.0,
        "collisions_per_min": 0.0,
        "pull_ins_per_min": 0.0,
        "pull_outs_per_min": 0.0,
        "parked_yaw_deg": {"kind": "uniform", "min": -8.0, "max": 8.0},
        "parked_gap_m": {"kind": "uniform", "min": 3.0, "max": 6.0},
    },
    "calm": {
        "speeding_kmh": {"kind": "constant", "value": 0.0},
        "gap_m": {"kind": "uniform", "min": 1.5, "max": 3.0},
        "lane_offset_m": {"kind": "constant", "value": 0.0},
        "lane_change_share": {"kind": "constant", "value": 0.0},
        "u_turns_per_min": 0.0,
        "collisions_per_min": 0.0,
        "pull_ins_per_min": 0.0,
        "pull_outs_per_min": 0.0,
        "parked_yaw_deg": {"kind": "constant", "value": 0.0},
    },
    "sumo": {
        "speeding_kmh": {"kind": "constant", "value": 0.0},
        "speeding_share": None,
        "gap_m": None,
        "headway_s": None,
        "lane_offset_m": {"kind": "constant", "value": 0.0},
        "lane_change_share": {"kind": "constant", "value": 0.0},
        "u_turns_per_min": 0.0,
        "collisions_per_min": 0.0,
        "pull_ins_per_min": 0.0,
        "pull_outs_per_min": 0.0,
        "parked_yaw_deg": {"kind": "constant", "value": 0.0},
    },
}


_HABIT_FIELDS = (
    *("speeding_share", "gap_m", "headway_s", "imperfection", "reaction_time_s", "acceleration_mps2", "braking_mps2"),
    *("startup_delay_s", "gap_acceptance_s", "driver_classes"),
)
_REPLACEABLE = frozenset(
    (
        *(*_HABIT_FIELDS, "cornering_mps2", "street_speed"),
        *("lane_offset_m", "lane_change_share", "u_turns_per_min", "pull_outs_per_min"),
    )
)
"""Settings that may be added to the preset `sumo`: driver parameters, lane speeds, and single manoeuvres."""


def _as_constant(value: Any) -> Any:
    """A uniform distribution of no width as a constant."""
    if isinstance(value, dict) and value.get("kind") == "uniform" and value["min"] == value["max"]:
        return {"kind": "constant", "value": value["min"]}
    return value


class DriverClasses(BaseModel):
    """A second class of drivers: each driver belongs to it with a probability."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    share: float = Field(ge=0, le=1, description="probability that a driver belongs to the second class [1]")
    speed_ratio: float = Field(gt=0.1, lt=5, description="desired speed of the second class over that of the first [1]")


class BehaviourConfig(BaseModel):
    """Drivers. Values that are not given follow the preset; a rate of zero or a constant zero switches a habit off."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    preset: Literal["paper", "reference", "calm", "sumo"] = Field(
        default="paper",
        description="where values come from by default; `sumo`: drivers as the scenario has them",
    )
    speeding_kmh: Annotated[Distribution, within(0, 60)] = Field(
        default=Uniform(min=0.0, max=30.0), description="how much a driver exceeds the limit on free roads [km/h]"
    )
    speeding_share: Annotated[Distribution, within(-0.5, 1)] | None = Field(
        default=Constant(value=0.0),
        description="difference between desired speed and limit, as a share of the limit; negative below the limit; "
        "none: the speedFactor of the vehicle type",
    )
    gap_m: Annotated[Distribution, within(0, 20)] | None = Field(
        default=Uniform(min=0.2, max=3.0),
        description="gap to the leader when standing [m]; none: the minGap of the vehicle type",
    )
    headway_s: Annotated[Distribution, within(0.3, 5)] | None = Field(
        default=Normal(mean=1.2, sigma=0.3, min=0.7, max=2.0),
        description="headway to the leader when driving [s]; none: the tau of the vehicle type",
    )
    lane_offset_m: Annotated[Distribution, within(-0.3, 0.3)] = Field(
        default=Uniform(min=-0.2, max=0.2),
        description="lateral offset from the lane's centre line, positive to the left [m]",
    )
    lane_change_share: Annotated[Distribution, within(0, 1)] = Field(
        default=Choice(values=(0.0, 0.4, 0.8), weights=None),
        description="chance that a driver changes to a side on a stretch of road with a lane there; for each side",
    )
    imperfection: Annotated[Distribution, within(0, 1)] | None = Field(
        default=None, description="SUMO's sigma, how unsteadily he keeps his speed [1]; none: as his vehicle type has"
    )
    reaction_time_s: Annotated[Distribution, within(0, 3)] | None = Field(
        default=None, description="time between two of his decisions [s]; none: he decides in every step"
    )
    acceleration_mps2: Annotated[Distribution, within(0.2, 10)] | None = Field(
        default=None, description="SUMO's accel, the largest acceleration [m/s²]; none: as the vehicle type has it"
    )
    braking_mps2: Annotated[Distribution, within(0.5, 12)] | None = Field(
        default=None,
        description="SUMO's decel, the usual largest deceleration [m/s²]; none: as the vehicle type has it",
    )
    startup_delay_s: Annotated[Distribution, within(0, 10)] | None = Field(
        default=None,
        description="SUMO's startupDelay, time before a standing driver sets off [s]; none: as the vehicle type has it",
    )
    gap_acceptance_s: Annotated[Distribution, within(0, 20)] | None = Field(
        default=None,
        description="SUMO's jmTimegapMinor, smallest time gap in the major stream that is accepted at a junction "
        "without own priority [s]; none: as the vehicle type has it",
    )
    cornering_mps2: Annotated[float, Field(gt=0, le=12, allow_inf_nan=False)] | None = Field(
        default=None,
        description="lateral acceleration to which drivers slow down in bends [m/s²]; none: 2.8 in `cosim run`, and "
        "the limits of the network's lanes with the preset `sumo` and in the traffic loop",
    )
    street_speed: StreetSpeed | None = Field(
        default=None, description="streets whose limits are multiplied by a factor; none: no street"
    )
    driver_classes: DriverClasses | None = Field(
        default=None, description="a second class of drivers with its own desired speed; none: one class"
    )
    u_turns_per_min: Rate = Field(default=1.0, description="U-turns away from junctions, per minute in the whole town")
    collisions_per_min: Rate = Field(default=0.4, description="drivers in the town a minute who brake too late")
    collision_stands_s: Annotated[Distribution, within(0, 600)] = Field(
        default=Uniform(min=15.0, max=45.0), description="time that vehicles stay at the location of a collision [s]"
    )
    pull_outs_per_min: Rate = Field(default=3.0, description="parked vehicles that drive off in the town a minute")
    pull_ins_per_min: Rate = Field(default=2.0, description="drivers in the town a minute who look for a place to park")

    parked_yaw_deg: Annotated[Distribution, within(-15, 15)] = Field(
        default=Normal(mean=0.0, sigma=1.5, min=-4.0, max=4.0),
        description="how much those turn away from the kerb's direction who are parked from the beginning [degrees]",
    )
    parked_gap_m: Annotated[Distribution, within(0.5, 20)] | None = Field(
        default=None, description="gap between them in a bay [m]; none: everyone in his own lot"
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, values: Any) -> Any:
        if isinstance(values, str):
            values = {"preset": values}
        if isinstance(values, dict):
            preset = values.get("preset", "paper")
            return {**(_PRESETS.get(preset, {}) if isinstance(preset, str) else {}), **values}
        return values

    @model_validator(mode="after")
    def _keeps_the_scenario(self) -> Self:
        if self.preset == "sumo":
            plain = {**BehaviourConfig().model_dump(mode="json"), **_PRESETS["sumo"], "preset": "sumo"}
            for key, value in self.model_dump(mode="json").items():
                if key not in _REPLACEABLE and _as_constant(value) != _as_constant(plain[key]):
                    raise ValueError(
                        f"the preset sumo leaves parked vehicles and accidents as the scenario has them, but {key} "
                        "would change them; take another preset"
                    )
        return self

    @property
    def changes_vtypes(self) -> bool:
        """Whether a driver's parameters differ from those of his vehicle type; with the preset sumo only."""
        offset = self.lane_offset_m.bounds != (0.0, 0.0)
        return self.as_given and (offset or any(getattr(self, key) is not None for key in _HABIT_FIELDS))

    @property
    def as_given(self) -> bool:
        """Whether drivers, lanes and vehicle types stay as the scenario has them."""
        return self.preset == "sumo"
