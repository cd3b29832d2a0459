"""Settings of the diagnosis of driver behaviour, each with its unit, grouped by step.

They were chosen on recordings of town02 with seeds that no benchmark uses. Constants that define a statistic, such as
the gap above which a driver is free, are in the modules of the channels.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from cosim.discrepancy import settings as sensor_loop


@dataclass(frozen=True)
class Gate:
    """Limits beyond which measured traffic differs significantly from a model's."""

    vehicle_freedom: float = (
        8.0  # degrees of freedom of the spread between vehicles, in addition to those between seeds
    )
    correlated: float = 0.7  # share of the correlations between columns in the null distribution
    draws: int = 4_000  # of the largest standardised difference
    fewest: int = 4  # vehicles that show a whole channel
    fewest_of_conditions: int = 6  # and a channel under a condition


@dataclass(frozen=True)
class Fitting:
    """Fits by simulation."""

    tried: int = 2  # candidates a round
    seeds: int = 2  # simulations a step of a fit
    slope_seeds: int = 1  # simulations of a slope: common random numbers leave little luck in differences
    direction_seeds: int = 2  # simulations of the directions in which behaviours change the channels
    near: float = 0.5  # share of a parameter's step for slopes about a fit
    small: float = 0.25  # standard errors: a refined fit that moves less is not simulated again
    nearly: float = 0.3  # minimum share of the best candidate's predicted gain for a fit
    rounds: int = 4  # steps of a fit at most
    enough: float = 0.1  # decrease of chi² too small for another simulation
    weak_steps: float = 5.0  # steps of a parameter: its prior standard deviation without data
    luck: float = 0.25  # a squared difference that luck makes more often than not


@dataclass(frozen=True)
class Placing:
    """Settings of the assignment of measured tracks to their network."""

    rests_mps: float = 0.1  # slower vehicles count as stopped
    leads_m: float = 80.0  # maximum clear distance to a leader
    usual_length_m: float = 4.5  # of who is of no known type
    usual_limit_mps: float = 13.9  # of a lane that has none
    straight: float = 1.6  # times its limit must a lane's bend allow


@dataclass(frozen=True)
class Simulating:
    """Settings of the model's vehicles: how they enter, drive and leave."""

    sublane_m: float = 0.8  # lateral resolution where measured changes of lane take their time
    jump_m: float = 1.5  # sideways within a step, by which changes of lane at once are recognised
    clear_m: float = 0.3  # by which a parked vehicle may extend out of its lot
    left_early_s: float = 2.0  # before a recording's end, to have left the town
    parked_every_s: float = 5.0  # between two samples of who is parked
    onward_every_s: float = 5.0  # between two looks at who needs a longer way
    ways_tried: int = 10  # to find it one
    most_per_min: float = 60.0  # maximum rate of incidents
    turn_clear_of_ends_m: float = 25.0  # from a junction, to turn round in the road
    turn_room_m: tuple[float, float] = (14.0, 8.0)  # free behind and before the place on the other side
    turn_brakes_mps2: float = 1.8  # to stop before it
    turn_waits_s: float = 20.0  # at most, for room
    lane_held_s: float = 6.0  # for which a wish for a lane is held


@dataclass(frozen=True)
class TrafficSettings:
    """All of them; level, coverage, power and the floor's margin are those of the loop for sensors."""

    level: float = sensor_loop.DEFAULT.level  # family-wise error rate of the gate
    coverage: float = sensor_loop.DEFAULT.coverage  # of intervals
    power: float = sensor_loop.DEFAULT.dictionary.power  # deviate that 80 % power adds to a critical value
    at_floor: float = sensor_loop.DEFAULT.at_floor  # share by which an error may be above its floor
    most_findings: int = 5
    shortest_s: float = 10.0  # of a recording
    longest_s: float = 7200.0
    judge_every: int = 3  # one of this number of vehicles is for validation and not used in fits
    gate: Gate = field(default_factory=Gate)
    fitting: Fitting = field(default_factory=Fitting)
    placing: Placing = field(default_factory=Placing)
    simulating: Simulating = field(default_factory=Simulating)


DEFAULT = TrafficSettings()
