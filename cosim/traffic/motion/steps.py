"""The steps that vehicles take of those they want."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cosim.traffic.headings import unit_vectors
from cosim.traffic.motion.chassis import Chassis
from cosim.traffic.motion.evasion import Rolling, evade
from cosim.traffic.motion.guard import Guarded, choose
from cosim.traffic.motion.script import Player
from cosim.traffic.motion.stopping import Stops, braked, stops

_SCRIPTS_STOP_IN = 4  # poses


@dataclass(frozen=True, eq=False)
class Company:
    """n vehicles on wheels about to take a step, the parked ones too.

    Attributes:
        state, want: before the step and as they want to be after it: `front` (n, 2) [m], `heading` [rad], `curvature`
            [1/m] and `speed` [m/s] of the rear axle's path (n,).
        chassis, size: of the vehicles; (n, 3) length, width, height [m].
        stuck_s: (n,) time for which they have blocked each other.
        players: row → script it plays.
        may_touch: pairs of rows (i < j).
    """

    state: dict[str, np.ndarray]
    want: dict[str, np.ndarray]
    chassis: Chassis
    size: np.ndarray
    stuck_s: np.ndarray
    players: dict[int, Player]
    may_touch: frozenset[tuple[int, int]]


def take_steps(company: Company, step_s: float) -> tuple[dict[str, np.ndarray], np.ndarray, dict[int, int]]:
    """Move all road users, except where bodies would touch.

    Returns:
        State after the step; (n,) bool, who did not go as he wants; row → row that was in its way.
    """
    state, rear = company.state, company.chassis.rear_m
    length, taken = company.size[:, 0], {name: values.copy() for name, values in company.want.items()}
    out = braked(state, rear, step_s)
    goes_on = stops(**taken, rear_m=rear, length_m=length, step_s=step_s, poses=_SCRIPTS_STOP_IN)
    moves = ((taken["front"] != state["front"]) | (out["front"] != state["front"])).any(1)
    for i, player in company.players.items():
        goes_on.put(i, player.stops(float(length[i]), goes_on=True), 0)
        moves[i] = True
    others: dict[int, Rolling] = {}

    def brake() -> Stops:
        brakes = stops(**out, rear_m=rear, length_m=length, step_s=step_s, poses=_SCRIPTS_STOP_IN)
        for i, player in company.players.items():
            brakes.put(i, player.stops(float(length[i]), goes_on=False), 0)
        return brakes

    def offer(i: int, clear: Callable[[Stops], np.ndarray]) -> Stops | None:
        other = None if i in company.players or company.chassis.on_rails[i] else _other_step(company, i, step_s, clear)
        if other is None:
            return None
        others[i], after = other
        return after

    forward = unit_vectors(state["heading"])
    centre = state["front"] - length[:, None] / 2 * forward
    half = company.size[:, :2] / 2
    yields, blocks = choose(Guarded(centre, state["heading"], half, goes_on, brake, moves, company.may_touch), offer)
    for i, chosen in yields.items():
        for name, values in taken.items():
            values[i] = out[name][i] if chosen is None else getattr(others[i], name)
    for i, player in company.players.items():
        player.slow_down() if i in yields else player.go()
        taken["front"][i], taken["heading"][i] = player.pose()
        taken["curvature"][i] = taken["speed"][i] = 0.0
    taken["heading"] = (taken["heading"] + np.pi) % (2 * np.pi) - np.pi
    waits = np.zeros(len(length), bool)
    waits[list(yields)] = True
    return taken, waits, blocks


def _other_step(
    company: Company, i: int, step_s: float, clear: Callable[[Stops], np.ndarray]
) -> tuple[Rolling, Stops] | None:
    chassis = company.chassis
    build = (
        float(chassis.rear_m[i]),
        float(company.size[i, 0]),
        float(chassis.max_curvature_per_m[i]),
        float(chassis.max_curvature_rate_per_ms[i]),
    )
    now, wish = (Rolling(*(values[i] for values in of_all.values())) for of_all in (company.state, company.want))
    return evade(now, wish, float(company.stuck_s[i]), build, step_s, clear)
