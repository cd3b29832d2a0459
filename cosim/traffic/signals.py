"""States of traffic signals: in a running simulation, and at any time of SUMO's clock."""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path
from types import ModuleType
from typing import Self

from cosim.traffic.starting import start_empty
from sumo_nets import Town
from sumo_nets.xml_guard import read_xml

_STEP_S = 0.1
_PROGRAMS = frozenset({"tlLogic", "WAUT", "wautJunction"})


class SignalStates:
    """Reads the state of every signalled lane.

    Args:
        api: the running libsumo.
        timed_only: leave out signals whose program looks at traffic.
    """

    def __init__(self, api: ModuleType, *, timed_only: bool = False) -> None:
        self._api = api
        self._timed_only = timed_only
        self._links: dict[str, tuple[str, int]] | None = None

    def now(self) -> dict[str, str]:
        """SUMO's letter (r, y, g, …) by lane: that of the lane's first link."""
        lights = self._api.trafficlight
        if self._links is None:
            self._links = {}
            acting = self.acting() if self._timed_only else frozenset()
            for name in sorted(set(lights.getIDList()) - acting):
                for index, links in enumerate(lights.getControlledLinks(name)):
                    for incoming, _, _ in links:
                        self._links.setdefault(incoming, (name, index))
        states = {name: lights.getRedYellowGreenState(name) for name in {name for name, _ in self._links.values()}}
        return {lane: states[name][index] for lane, (name, index) in self._links.items()}

    def acting(self) -> frozenset[str]:
        """Signals with a program that looks at traffic (actuated, delay-based, NEMA, at rails)."""
        lights, timed = self._api.trafficlight, self._api.constants.TRAFFICLIGHT_TYPE_STATIC
        programs = {name: lights.getAllProgramLogics(name) for name in lights.getIDList()}
        return frozenset(name for name, all_ in programs.items() if any(one.type != timed for one in all_))


class SignalClock:
    """States of a town's traffic lights at times of SUMO's clock, for programs that depend only on time.

    SUMO itself runs the programs on empty streets; a context manager, one at a time in a process, without any other
    simulation in parallel.

    Args:
        town: its network and the signal programs of its additional files.
        begin_s: when the simulation began.

    Raises:
        TrafficError: SUMO refuses the programs, or another simulation runs in this process.
    """

    def __init__(self, town: Town, begin_s: float) -> None:
        self._town, self._begin_s = town, begin_s
        self._start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._sumo.close()

    @property
    def unknown(self) -> tuple[str, ...]:
        """Traffic lights whose state does not follow from time, as their programs are actuated by traffic."""
        return tuple(sorted(self._states.acting()))

    def at(self, time_s: float) -> dict[str, str]:
        """SUMO's letter by lane at a time; lanes of `unknown` signals are not there."""
        simulation = self._sumo.simulation
        if simulation.getTime() > time_s + _STEP_S * 1.5:
            self._sumo.close()
            self._start()
        # After the step of a time the clock shows the next one.
        simulation.step(time_s + _STEP_S)
        return self._states.now()

    def _start(self) -> None:
        with tempfile.TemporaryDirectory(prefix="cosim-") as folder:
            programs = _programs(self._town, Path(folder))
            options = {} if self._town.scenario is None else self._town.scenario.options
            off = options.get("tls.all-off", "false")
            self._sumo = start_empty(self._town.net, programs, self._begin_s, _STEP_S, {"tls.all-off": off})
        self._states = SignalStates(self._sumo, timed_only=True)


def _programs(town: Town, folder: Path) -> Path:
    """The signal programs of a town's additional files, as a file of their own."""
    found = ET.Element("additional")
    for path in town.runnable_additional(folder):
        found.extend([element for element in read_xml(path) if element.tag in _PROGRAMS])
    target = folder / "programs.add.xml"
    target.write_bytes(ET.tostring(found))
    return target
