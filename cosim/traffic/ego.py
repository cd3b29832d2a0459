"""Choice of the vehicle that carries the sensors."""

from __future__ import annotations

import numpy as np

from cosim.traffic.actors import Actors
from cosim.traffic.simulation import Traffic
from cosim.traffic.starting import TrafficError

_RIDDEN = ("car", "van", "truck", "bus", "motorcycle", "cyclist")  # the first of these kinds that drives
_MOVES_MPS = 1.0
_DISPATCH = "`taxi_dispatch: greedy` into the configuration (--taxi-dispatch greedy)"


class ArrivedError(TrafficError):
    """All vehicles have arrived, and none departs later."""


def draw_ego(traffic: Traffic, actors: Actors, rng: np.random.Generator) -> str:
    """The id of a vehicle to ride in: a car that drives, drawn at random; without cars, one of the next kind.

    Raises:
        TrafficError: nothing drives.
    """
    driving = _ridable(traffic, actors)
    if not driving:
        is_over = not anybody_comes(traffic) and _count(traffic, "vehicles.inserted") > 0
        kind = ArrivedError if is_over else TrafficError
        raise kind(f"no road vehicle drives after {actors.time_s:.0f} s: {_reason(traffic, actors)}")
    kind = min((actors.kinds[row] for row in driving), key=_RIDDEN.index)
    driving = [row for row in driving if actors.kinds[row] == kind]
    moving = [row for row in driving if actors.speed_mps[row] > _MOVES_MPS]
    return str(rng.choice(sorted(actors.ids[row] for row in moving or driving)))


def _reason(traffic: Traffic, actors: Actors) -> str:
    """Return the reason why no vehicle moves, from SUMO's state, and what to do."""
    standing = sum(kind in _RIDDEN for kind in actors.kinds)
    taxis = traffic.api.vehicle.getTaxiFleet(-1)
    if taxis:
        return (
            f"taxis waiting for a dispatcher, which is a program outside this scenario: {len(taxis)}; write "
            f'{_DISPATCH} or <device.taxi.dispatch-algorithm value="greedy"/> into the .sumocfg for the one of SUMO'
        )
    waiting = sum(_waits_for_ride(traffic, person) for person in traffic.api.person.getIDList())
    if waiting and standing:
        return (
            f"transport on demand without a dispatcher, which is a program outside this scenario (persons waiting for "
            f"rides: {waiting}, vehicles waiting for commands: {standing}); write {_DISPATCH} for the one of SUMO"
        )
    if not anybody_comes(traffic) and not _count(traffic, "vehicles.inserted"):
        persons = _count(traffic, "persons.loaded")
        return f"the scenario has no vehicle that departs (persons: {persons}); add vehicles with routes"
    if not anybody_comes(traffic):
        return "all vehicles have arrived and none departs later; shorten warm_up_s, or add traffic"
    return f"{standing} vehicles are stopped, others have not departed; increase warm_up_s, or add vehicles with routes"


def _count(traffic: Traffic, name: str) -> int:
    """Return a number of SUMO's statistics output since the start, as `vehicles.inserted`."""
    return int(traffic.api.simulation.getParameter("", f"stats.{name}") or 0)


def _waits_for_ride(traffic: Traffic, person: str) -> bool:
    """Return whether a person is on foot at the start of a ride."""
    stage = traffic.api.person.getStage(person)
    return stage.type == traffic.api.constants.STAGE_DRIVING and not traffic.api.person.getVehicle(person)


def anybody_drives(traffic: Traffic, actors: Actors) -> bool:
    """Whether there is a vehicle to ride in."""
    return bool(_ridable(traffic, actors))


def anybody_comes(traffic: Traffic) -> bool:
    """Return whether SUMO still expects road users, now or later."""
    return traffic.api.simulation.getMinExpectedNumber() > 0


def _ridable(traffic: Traffic, actors: Actors) -> list[int]:
    """Rows of vehicles on the road without a stop ahead; if all have one (buses, shared taxis), of moving ones."""
    types, lanes = actors.kinds, actors.lanes
    on_road = [row for row in range(len(actors)) if types[row] in _RIDDEN and lanes[row] and not actors.parked[row]]
    free = [row for row in on_road if not traffic.api.vehicle.getStops(actors.ids[row], 1)]
    return free or [row for row in on_road if actors.speed_mps[row] > _MOVES_MPS]
