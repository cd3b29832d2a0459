"""Recorded events of driver behaviour."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

EventKind = Literal["lane_change", "u_turn", "pull_out", "pull_in", "collision", "contact", "taken_away"]


@dataclass(frozen=True)
class Event:
    """One event.

    Attributes:
        kind: type of event. A collision is one that the configuration requests; a contact is any other overlap of
            two bodies. Who cannot get on any more, or has lost his way, is taken away, out of the ego vehicle's sight.
        time_s: simulation time when it began.
        vehicles: SUMO ids of those who took part, the one at fault first.
    """

    kind: EventKind
    time_s: float
    vehicles: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Keys and values for a manifest."""
        return {"kind": self.kind, "time_s": round(self.time_s, 3), "vehicles": list(self.vehicles)}
