"""Record an episode of a large town: simulate first, then build what is in sight of the route, then measure."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import NamedTuple

import numpy as np

from cosim.capture.mast import Mast
from cosim.capture.plan import EpisodePlan
from cosim.capture.recorder import Recorder
from cosim.traffic.actors import Actors


class _Instant(NamedTuple):
    """State of the traffic at a frame; `carrier` carries the sensors, `signals` maps lane to SUMO's state letter."""

    name: str
    actors: Actors
    carrier: str | Mast
    signals: Mapping[str, str]

    @property
    def position(self) -> np.ndarray:
        """Position (2,) of the carrier [m]."""
        if isinstance(self.carrier, Mast):
            return np.array([self.carrier.x_m, self.carrier.y_m])
        return self.actors.front[self.actors.ids.index(self.carrier), :2]


class RouteRecorder:
    """Keeps the states of a simulation until its end, then records its frames in the surroundings of the route.

    The surroundings depend on all frames of the simulation, also on those that exist already, so that a resumed
    episode is recorded in the same world.

    Args:
        recorder: records the frames.
        plan: plan of the episode.
        done: names of frames that exist already.
        on_frame: called with the name of each recorded frame.
    """

    def __init__(
        self, recorder: Recorder, plan: EpisodePlan, done: Collection[str], on_frame: Callable[[str], None]
    ) -> None:
        self._recorder, self._plan = recorder, plan
        self._done, self._on_frame = done, on_frame
        self._instants: list[_Instant] = []
        self._attempt = 0

    def record(
        self, name: str, plan: EpisodePlan, actors: Actors, carrier: str | Mast, signals: Mapping[str, str]
    ) -> None:
        """Keep the state of the traffic at a frame."""
        self._instants.append(_Instant(name, actors, carrier, dict(signals)))

    def note(self, entry: dict[str, object]) -> None:
        """Record the frames of a simulation that has ended, then write its manifest entry."""
        instants, self._instants = self._instants, []
        missing = [instant for instant in instants if instant.name not in self._done]
        if missing:
            route = np.stack([instant.position for instant in instants])
            self._recorder.move_along(self._plan, self._attempt, route)
        for instant in missing:
            self._recorder.record(instant.name, self._plan, instant.actors, instant.carrier, instant.signals)
            self._on_frame(instant.name)
        self._recorder.note(entry)
        self._attempt += 1
