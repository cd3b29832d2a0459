"""How drivers behave: distributions of habits and rates of incidents."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from cosim.traffic.behaviour.distributions import Choice, Constant, Distribution, Normal, Uniform, within

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
        "lane_offset_m": {"kind": "constant", "value": 0.0},
        "lane_change_share": {"kind": "constant", "value": 0.0},
        "u_turns_per_min": 0.0,
        "collisions_per_min": 0.0,
        "pull_ins_per_min": 0.0,
        "pull_outs_per_min": 0.0,
        "parked_yaw_deg": {"kind": "constant", "value": 0.0},
    },
}


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
    speeding_share: Annotated[Distribution, within(-0.5, 1)] = Field(
        default=Constant(value=0.0),
        description="how much he exceeds it besides, as a share of the limit; who stays below it has a negative one",
    )
    gap_m: Annotated[Distribution, within(0, 20)] = Field(
        default=Uniform(min=0.2, max=3.0), description="gap to the leader when standing [m]"
    )
    headway_s: Annotated[Distribution, within(0.3, 5)] = Field(
        default=Normal(mean=1.2, sigma=0.3, min=0.7, max=2.0), description="headway to the leader when driving [s]"
    )
    lane_offset_m: Annotated[Distribution, within(-0.3, 0.3)] = Field(
        default=Uniform(min=-0.2, max=0.2), description="place beside the lane's middle, positive to the left [m]"
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
    u_turns_per_min: Rate = Field(
        default=1.0, description="U-turns in the middle of the road begun in the town a minute"
    )
    collisions_per_min: Rate = Field(default=0.4, description="drivers in the town a minute who brake too late")
    collision_stands_s: Annotated[Distribution, within(0, 600)] = Field(
        default=Uniform(min=15.0, max=45.0), description="how long those stand who have collided [s]"
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
    def _stands_alone(self) -> Self:
        if self.preset == "sumo":
            plain = {**BehaviourConfig().model_dump(mode="json"), **_PRESETS["sumo"], "preset": "sumo"}
            for key, value in self.model_dump(mode="json").items():
                if value != plain[key]:
                    raise ValueError(
                        f"the preset sumo leaves drivers as the scenario's vTypes have them, but {key} would change "
                        f"them; write it into the vTypes, or take another preset"
                    )
        return self

    @property
    def as_given(self) -> bool:
        """Whether drivers, lanes and vehicle types stay as the scenario has them."""
        return self.preset == "sumo"
