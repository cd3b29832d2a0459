"""What the signals of a running simulation show."""

from __future__ import annotations

from types import ModuleType


class SignalStates:
    """Reads the state of every signalled lane.

    Args:
        api: the running libsumo.
    """

    def __init__(self, api: ModuleType) -> None:
        self._api = api
        self._links: dict[str, tuple[str, int]] | None = None

    def now(self) -> dict[str, str]:
        """SUMO's letter (r, y, g, …) by lane: that of the lane's first link."""
        lights = self._api.trafficlight
        if self._links is None:
            self._links = {}
            for name in sorted(lights.getIDList()):
                for index, links in enumerate(lights.getControlledLinks(name)):
                    for incoming, _, _ in links:
                        self._links.setdefault(incoming, (name, index))
        states = {name: lights.getRedYellowGreenState(name) for name in {name for name, _ in self._links.values()}}
        return {lane: states[name][index] for lane, (name, index) in self._links.items()}
