"""Record an episode: simulate the traffic of a town and record frames from it."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from typing import Any, Protocol

import numpy as np

from cosim.capture.collection import COMPANY_M, FrameSelector, StationaryFrameSelector
from cosim.capture.config import RunConfig
from cosim.capture.episode_start import EpisodeStarts
from cosim.capture.mast import Mast, choose_mast
from cosim.capture.plan import EpisodePlan
from cosim.traffic.actors import Actors
from cosim.traffic.driven_traffic import DrivenTraffic
from cosim.traffic.ego import ArrivedError, anybody_comes, anybody_drives, draw_ego
from cosim.traffic.signals import SignalStates
from cosim.traffic.simulation import Traffic
from sumo_nets import Town

_SIGHT_M = 120.0  # range of a LiDAR
_LONGEST_WAIT_S = 900.0  # for the first vehicle of a scenario

_log = logging.getLogger(__name__)
_SHORTEST_WARM_UP_S = 1.0


class FrameRecorder(Protocol):
    """Interface of an object that records frames."""

    def record(
        self, name: str, plan: EpisodePlan, actors: Actors, carrier: str | Mast, signals: Mapping[str, str]
    ) -> None:
        """Measure the world at one step from a vehicle or a mast and write the frame; `signals` maps lane to state."""

    def note(self, entry: dict[str, object]) -> None:
        """Write a manifest entry about the episode."""


def run_episode(
    plan: EpisodePlan,
    config: RunConfig,
    town: Town,
    recorder: FrameRecorder,
    *,
    done: Collection[str],
    on_frame: Callable[[str], None],
    on_step: Callable[[], None] = lambda: None,
    starts: EpisodeStarts | None = None,
) -> None:
    """Simulate an episode and record its missing frames.

    The simulation depends only on the run's seed and the episode's number. An episode that is resumed after an
    interruption therefore passes through the same states. A simulation that jams ends early, and another one with a
    different seed provides the remaining frames.

    Args:
        plan: plan of the episode.
        config: configuration of the run.
        town: town of the episode.
        recorder: records the frames.
        done: names of frames that exist already.
        on_frame: called with the name of each recorded frame.
        on_step: called after every simulation step.
        starts: starts of episodes that are prepared ahead.

    Raises:
        TrafficError: SUMO refuses the scenario.
        TownError: the town cannot be populated.
    """
    remaining = list(plan.frames)
    for attempt in range(config.collection.attempts):
        remaining = _simulate_with_shorter_warm_up(
            plan, attempt, remaining, config, starts or EpisodeStarts(config), town, recorder, done, on_frame, on_step
        )
        if not remaining:
            return


def _simulate_with_shorter_warm_up(
    plan: EpisodePlan, attempt: int, frames: list[str], config: RunConfig, *rest: Any
) -> list[str]:
    """Run one simulation; halve the warm-up as long as all vehicles arrive before it ends."""
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
    starts: EpisodeStarts,
    town: Town,
    recorder: FrameRecorder,
    done: Collection[str],
    on_frame: Callable[[str], None],
    on_step: Callable[[], None],
) -> list[str]:
    """Run one simulation; return the names of the frames that it did not reach."""
    rules, remaining = config.collection, list(frames)
    is_scenario = town.scenario is not None
    with starts.take(plan, attempt, config, town) as start:
        rng, state = start.rng, start.state()
        with Traffic(
            start.sumocfg,
            start.seed,
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
                may_appear=is_scenario,
                beside_parked=start.beside_parked,
                on_step=on_step,
            )
            actors = living.step() if state else living.advance(max(2, round(start.lead_in_s / config.step_s)))
            actors = _wait_for_vehicle(traffic, living, actors, config)
            carrier: str | Mast = draw_ego(traffic, actors, rng)
            if config.rig_used.carrier == "mast":
                carrier = choose_mast(town.streets, config.mast, _driven_positions(actors), rng)
                living.attend(np.array([carrier.x_m, carrier.y_m]))
            else:
                living.follow(carrier)
            if state:
                actors = living.advance(round(start.lead_in_s / config.step_s))
            states = SignalStates(traffic.api)
            selector, reason = _make_selector(config, actors, carrier, is_scenario=is_scenario), None
            while remaining and reason is None:
                if isinstance(carrier, str):
                    traffic.prolong_route(carrier, rng)
                actors = living.advance(max(1, round(rules.every_s / config.step_s)))
                reason = selector.end_reason(actors)
                if reason is None and selector.selects(actors):
                    name = remaining.pop(0)
                    if name not in done:
                        recorder.record(name, plan, living.everyone(actors), carrier, states.now())
                        on_frame(name)
            events = Counter(event.kind for event in living.events)
            count = len(frames) - len(remaining)
            recorder.note(plan.note(attempt, town.name, count, reason, actors.time_s, events))
    return remaining


def _make_selector(
    config: RunConfig, actors: Actors, carrier: str | Mast, *, is_scenario: bool
) -> FrameSelector | StationaryFrameSelector:
    if isinstance(carrier, Mast):
        position = np.array([carrier.x_m, carrier.y_m])
        return StationaryFrameSelector(config.collection, actors.time_s, position, carrier.heading_rad)
    return FrameSelector(config.collection, actors, carrier, 0.0 if is_scenario else COMPANY_M)


def _driven_positions(actors: Actors) -> np.ndarray:
    """Positions of the vehicles that are on a lane and not parked, (n, 2) [m]."""
    is_driving = [bool(lane) and not parked for lane, parked in zip(actors.lanes, actors.parked, strict=True)]
    return actors.front[np.array(is_driving, bool), :2]


def _wait_for_vehicle(traffic: Traffic, living: DrivenTraffic, actors: Actors, config: RunConfig) -> Actors:
    """Simulate until there is a vehicle that can carry the sensors, as long as one is expected to depart."""
    for _ in range(round(_LONGEST_WAIT_S / config.step_s)):
        if anybody_drives(traffic, actors) or not anybody_comes(traffic):
            break
        actors = living.step()
    return actors
