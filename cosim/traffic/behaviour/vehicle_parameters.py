"""Setting the parameters of a driver in a running simulation."""

from __future__ import annotations

from typing import Any

import numpy as np

from cosim.traffic.behaviour.config import BehaviourConfig
from cosim.traffic.behaviour.habits import Habits, draw_habits
from cosim.traffic.behaviour.stage import Stage


def set_parameters(api: Any, vehicle: str, habits: Habits, step_s: float) -> None:
    """Set those parameters of a vehicle that are not left to its type; speed factor and lateral position excepted.

    Args:
        api: libsumo's `vehicle` domain.
        vehicle: SUMO's id.
        habits: of its driver.
        step_s: of the simulation [s].
    """
    setters = (
        (api.setMinGap, habits.gap_m),
        (api.setTau, habits.headway_s),
        (api.setImperfection, habits.imperfection),
        (api.setAccel, habits.accel_mps2),
        (api.setDecel, habits.decel_mps2),
    )
    for setter, value in setters:
        if value is not None:
            setter(vehicle, value)
    if habits.reaction_s is not None:
        api.setActionStepLength(vehicle, max(1, round(habits.reaction_s / step_s)) * step_s)
    for name, value in (("startupDelay", habits.startup_delay_s), ("jmTimegapMinor", habits.time_gap_s)):
        if value is not None:
            api.setParameter(vehicle, f"vehicle.{name}", f"{value:.3f}")


class ChangedParameters:
    """Replaces single parameters of vehicle types while everything else stays as the scenario has it.

    Args:
        config: the behaviour, of the preset `sumo`.
        seed: of all draws.
    """

    def __init__(self, config: BehaviourConfig, seed: int) -> None:
        self._config, self._seed = config, seed
        self._seen: set[str] = set()

    def step(self, stage: Stage) -> None:
        """Set the parameters of vehicles that are new."""
        actors, api = stage.actors, stage.api.vehicle
        self._seen.difference_update(stage.left)
        for row in np.flatnonzero(~actors.parked).tolist():
            vehicle = actors.ids[row]
            if vehicle in self._seen or actors.kinds[row] in ("pedestrian", "tram"):
                continue
            self._seen.add(vehicle)
            habits = draw_habits(self._config, self._seed, vehicle)
            set_parameters(api, vehicle, habits, stage.step_s)
            if habits.lane_offset_m:
                stage.motion.keep_offset(vehicle, habits.lane_offset_m)
            own = api.getSpeedFactor(vehicle)
            factor = habits.speed_factor(np.inf, own)
            if factor != own:
                api.setSpeedFactor(vehicle, max(factor, 0.1))
