"""One episode: simulations of a town's traffic from which its frames are recorded."""

from __future__ import annotations

import logging
import tempfile
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from assets.ranges import draw
from cosim.capture.collection import COMPANY_M, StillWatch, Watch
from cosim.capture.config import RunConfig
from cosim.capture.mast import Mast, stand_mast
from cosim.capture.plan import EpisodePlan
from cosim.traffic.actors import Actors
from cosim.traffic.driven_traffic import DrivenTraffic
from cosim.traffic.ego import ArrivedError, anybody_comes, anybody_drives, draw_ego
from cosim.traffic.signals import SignalStates
from cosim.traffic.simulation import Traffic
from cosim.traffic.starting import warmed_up
from sumo_nets import RECIPES, Town, write_demand
from sumo_nets.dispatch import with_dispatcher

_SIGHT_M = 120.0  # as far as a LiDAR sees
_LEAD_IN_S = 8.0  # until bodies follow, drivers have their habits, and some are in a manoeuvre
_LONGEST_WAIT_S = 900.0  # for the first vehicle of a scenario

_log = logging.getLogger(__name__)
_SHORTEST_WARM_UP_S = 1.0


class FrameRecorder(Protocol):
    """What takes a frame."""

    def record(
        self, name: str, plan: EpisodePlan, actors: Actors, carrier: str | Mast, signals: Mapping[str, str]
    ) -> None:
        """Measure the world at one step, from a vehicle or a mast, and write the frame; `signals` tells by lane."""

    def note(self, entry: dict[str, object]) -> None:
        """Write a remark about the episode."""


def run_episode(
    plan: EpisodePlan,
    config: RunConfig,
    town: Town,
    recorder: FrameRecorder,
    *,
    done: Collection[str],
    on_frame: Callable[[str], None],
    on_step: Callable[[], None] = lambda: None,
) -> None:
    """Simulate an episode and record those of its frames that are not done.

    All that happens follows from the run's seed and the episode's number alone, so an episode that is taken up
    again after an interruption passes through the same states. A simulation that jams ends early, and another,
    differently seeded, gives the frames that are left.

    Raises:
        TrafficError: SUMO refuses the scenario.
        TownError: the town cannot be populated.
    """
    left = list(plan.frames)
    for attempt in range(config.collection.attempts):
        left = _simulate_early(plan, attempt, left, config, town, recorder, done, on_frame, on_step)
        if not left:
            return


def _simulate_early(plan: EpisodePlan, attempt: int, frames: list[str], config: RunConfig, *rest: Any) -> list[str]:
    """One simulation; where all vehicles have arrived before the warm-up ends, one with a warm-up half as long."""
    while True:
        try:
            return _simulate(plan, attempt, frames, config, *rest)
        except ArrivedError as error:
            if config.warm_up_s < _SHORTEST_WARM_UP_S:
                raise
            warm_up_s = round(config.warm_up_s / 2, 3)
            _log.warning("%s; the warm-up is shortened from %g to %g s", error, config.warm_up_s, warm_up_s)
            config = config.model_copy(update={"warm_up_s": warm_up_s})


def _simulate(
    plan: EpisodePlan,
    attempt: int,
    frames: list[str],
    config: RunConfig,
    town: Town,
    recorder: FrameRecorder,
    done: Collection[str],
    on_frame: Callable[[str], None],
    on_step: Callable[[], None],
) -> list[str]:
    """One simulation; gives the names of the frames it did not come to."""
    rng = np.random.default_rng([config.seed, plan.number, attempt])
    rules, left = config.collection, list(frames)
    # A user's scenario is simulated step by step from its beginning: a saved state does not hold all that one may have.
    seen_s = config.warm_up_s if town.scenario is not None else min(config.warm_up_s, _LEAD_IN_S)
    with tempfile.TemporaryDirectory(prefix="cosim-") as folder:
        sumocfg, beside_parked = populated(town, config, rng, Path(folder))
        seed, state, own = int(rng.integers(2**31)), None, town.scenario is not None
        if config.warm_up_s > seen_s:
            state = warmed_up(sumocfg, seed, config.warm_up_s - seen_s, Path(folder))
        with Traffic(
            sumocfg,
            seed,
            config.step_s,
            state,
            as_given=config.behaviour.as_given,
            cornering_mps2=config.behaviour.cornering_mps2,
            street_speed=config.behaviour.street_speed,
        ) as traffic:
            living = DrivenTraffic(
                traffic,
                config.behaviour,
                int(rng.integers(2**31)),
                sight_m=max(_SIGHT_M, config.label_range_m),
                may_appear=own,
                beside_parked=beside_parked,
                on_step=on_step,
            )
            actors = living.step() if state else living.advance(max(2, round(seen_s / config.step_s)))
            actors = _until_somebody_drives(traffic, living, actors, config)
            carrier: str | Mast = draw_ego(traffic, actors, rng)
            if config.rig_used.carrier == "mast":
                carrier = stand_mast(town.streets, config.mast, _driven_places(actors), rng)
                living.attend(np.array([carrier.x_m, carrier.y_m]))
            else:
                living.follow(carrier)
            if state:
                actors = living.advance(round(seen_s / config.step_s))
            states = SignalStates(traffic.api)
            watch, reason = _watch(config, actors, carrier, own=own), None
            while left and reason is None:
                if isinstance(carrier, str):
                    traffic.prolong_route(carrier, rng)
                actors = living.advance(max(1, round(rules.every_s / config.step_s)))
                reason = watch.end_reason(actors)
                if reason is None and watch.wants(actors):
                    name = left.pop(0)
                    if name not in done:
                        recorder.record(name, plan, living.everyone(actors), carrier, states.now())
                        on_frame(name)
            events = Counter(event.kind for event in living.events)
            taken = len(frames) - len(left)
            recorder.note(plan.note(attempt, town.name, taken, reason, actors.time_s, events))
    return left


def _watch(config: RunConfig, actors: Actors, carrier: str | Mast, *, own: bool) -> Watch | StillWatch:
    if isinstance(carrier, Mast):
        place = np.array([carrier.x_m, carrier.y_m])
        return StillWatch(config.collection, actors.time_s, place, carrier.heading_rad)
    return Watch(config.collection, actors, carrier, 0.0 if own else COMPANY_M)


def _driven_places(actors: Actors) -> np.ndarray:
    """Where somebody drives, (n, 2)."""
    drives = [bool(lane) and not parked for lane, parked in zip(actors.lanes, actors.parked, strict=True)]
    return actors.front[np.array(drives, bool), :2]


def _until_somebody_drives(traffic: Traffic, living: DrivenTraffic, actors: Actors, config: RunConfig) -> Actors:
    """Go on until there is a vehicle to ride in, as long as one may come."""
    for _ in range(round(_LONGEST_WAIT_S / config.step_s)):
        if anybody_drives(traffic, actors) or not anybody_comes(traffic):
            break
        actors = living.step()
    return actors


def populated(town: Town, config: RunConfig, rng: np.random.Generator, folder: Path) -> tuple[Path, float]:
    """The scenario to simulate: a population of its own for a built-in town, a user's town as it is.

    Returns:
        The scenario's file, and the share of its parked vehicles that people are about.
    """
    if town.scenario is not None and config.taxi_dispatch is not None:
        return with_dispatcher(town.scenario, config.taxi_dispatch).write(folder), 0.0
    if town.scenario is not None:
        return town.runnable(folder), 0.0
    demand = config.population.draw(RECIPES[town.name].demand, rng)
    share = draw(config.population.beside_parked, rng.spawn(1)[0])
    return write_demand(town, demand, int(rng.integers(2**31)), folder), share
