"""The steps that vehicles take: those they want, else slower ones or, at walking pace, other turns of the wheels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cosim.traffic.headings import unit_vectors
from cosim.traffic.motion.chassis import Chassis
from cosim.traffic.motion.guard import Guarded, choose
from cosim.traffic.motion.script import Player
from cosim.traffic.motion.stopping import BRAKES_MPS2, Stops, braked, stops, travel

_SCRIPTS_STOP_IN = 4  # poses
_EASES_MPS2 = (2.5, 5.0)
_CREEPS_BELOW_MPS = 1.0
_CREEPS_MPS = 0.5
_LOOKS_M = 0.5  # a creeping vehicle sees whether it could go on as far
_TURNS = (0.25, -0.25, 0.5, -0.5, 0.75, -0.75, 1.0, -1.0)  # of the largest curvature
_TRIES_S = 1.5  # standing so long it tries to get round what is in the way


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
    others: dict[int, _Rolling] = {}

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
) -> tuple[_Rolling, Stops] | None:
    chassis = company.chassis
    build = (
        float(chassis.rear_m[i]),
        float(company.size[i, 0]),
        float(chassis.max_curvature_per_m[i]),
        float(chassis.max_curvature_rate_per_ms[i]),
    )
    now, wish = (_Rolling(*(values[i] for values in of_all.values())) for of_all in (company.state, company.want))
    return _evade(now, wish, float(company.stuck_s[i]), build, step_s, clear)


@dataclass(frozen=True, eq=False)
class _Rolling:
    """One vehicle's rear-axle bicycle: front bumper (2,) [m], heading [rad], curvature [1/m] and speed [m/s]."""

    front: np.ndarray
    heading: float
    curvature: float
    speed: float


def _evade(
    now: _Rolling,
    wanted: _Rolling,
    waits_s: float,
    build: tuple[float, float, float, float],
    step_s: float,
    clear: Callable[[Stops], np.ndarray],
) -> tuple[_Rolling, Stops] | None:
    """The first other step that is clear, and the stops after it: eased, or round what is in the way.

    Args:
        now: before the step.
        wanted: after the step that is not clear.
        waits_s: for how long it could not go as it wants.
        build: rear axle behind the bumper, length [m], largest curvature [1/m], and how fast that changes [1/(m·s)].
        step_s: length of the step.
        clear: (k,) bool, stops that keep clear of all other bodies.
    """
    rear, length, largest, rate = build
    looks = None
    if now.speed > _CREEPS_BELOW_MPS:
        curvature = np.full(len(_EASES_MPS2), wanted.curvature)
        speed = np.array([max(min(wanted.speed, now.speed - ease * step_s), 0.0) for ease in _EASES_MPS2])
    elif waits_s < _TRIES_S or wanted.speed <= 0.0:
        return None
    else:
        reach = rate * step_s if now.speed > 0.05 else np.inf  # wheels turn at rest
        turns = np.array(sorted(_TURNS, key=lambda turn: abs(turn * largest - wanted.curvature))) * largest
        curvature = np.clip(turns, now.curvature - reach, now.curvature + reach)
        speed = np.full(len(turns), min(_CREEPS_MPS, now.speed + 0.2))
        looks = np.full(len(turns), np.sqrt(2 * BRAKES_MPS2 * _LOOKS_M))
    k = len(speed)
    front, heading = travel(
        np.tile(now.front, (k, 1)), np.full(k, now.heading), curvature, speed * step_s, np.full(k, rear)
    )
    after = stops(front, heading, curvature, speed, np.full(k, rear), np.full(k, length), step_s)
    free = clear(after)
    if looks is not None and free.any():
        free &= clear(stops(front, heading, curvature, looks, np.full(k, rear), np.full(k, length), step_s))
    if not free.any():
        return None
    i = int(np.argmax(free))
    rolled = _Rolling(front[i], float(heading[i]), float(curvature[i]), float(speed[i]))
    return rolled, after.take(np.array([i]))
