"""Looks at every step of a simulation and keeps the worst of each kind of implausible motion."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from cosim.traffic.actors import Actors
from cosim.traffic.motion import overlaps

MOVES_MPS = 0.5  # below, relative errors of speed mean nothing
_FORGETS_S = 1.0


@dataclass(eq=False)
class Touch:
    """A stretch of time in which the boxes of two vehicles overlap.

    Attributes:
        vehicles: in alphabetical order.
        begin_s, end_s: first and last instant.
        depth_m: the deepest overlap, at `deepest_s`.
        scene: who they are and what they do at that instant.
    """

    vehicles: tuple[str, str]
    begin_s: float
    end_s: float
    depth_m: float = 0.0
    deepest_s: float = 0.0
    scene: str = ""


def centres(actors: Actors) -> np.ndarray:
    """Middles of the boxes (n, 2)."""
    walks = np.array([kind == "pedestrian" for kind in actors.kinds], bool)
    forward = np.column_stack([np.cos(actors.heading_rad), np.sin(actors.heading_rad)])
    return actors.front[:, :2] - np.where(walks, 0, actors.size[:, 0] / 2)[:, None] * forward


@dataclass(eq=False)
class Inspector:
    """Compares poses of successive steps.

    Attributes:
        step_s: between them.
        tolerance_m: overlaps of boxes below are none.
        steps: vehicle-steps of those who are not parked.
        sideways_m, turn_deg: largest movement of a box's centre across its heading, and turn, in one step.
        speed_errors: of speeds from differenced poses against reported ones, relative, of all who move.
        touches: all overlaps.
        surprises: (time, vehicle) of those who appeared or vanished within `sight_m` of the ego vehicle.
    """

    step_s: float = 0.1
    tolerance_m: float = 0.0
    sight_m: float = 80.0
    steps: int = 0
    sideways_m: float = 0.0
    turn_deg: float = 0.0
    speed_errors: list[np.ndarray] = field(default_factory=list)
    touches: list[Touch] = field(default_factory=list)
    surprises: list[tuple[float, str]] = field(default_factory=list)
    _open: dict[tuple[str, str], Touch] = field(default_factory=dict)
    _before: tuple[dict[str, int], np.ndarray, np.ndarray] | None = None

    def look(self, actors: Actors, ego: str = "") -> None:
        """Compare a step with the last; there may be an ego vehicle by now."""
        drives = np.array([kind != "pedestrian" for kind in actors.kinds], bool)
        centre, rows = centres(actors), {name: row for row, name in enumerate(actors.ids)}
        if self._before is not None:
            known, centre_0, heading_0 = self._before
            both = [(row, known[name]) for name, row in rows.items() if drives[row] and name in known]
            now, was = np.array(both, int).reshape(-1, 2).T
            self._compare(actors, now, centre[now] - centre_0[was], heading_0[was])
            if ego in rows and ego in known:
                places = {name: centre[row] for name, row in rows.items() if name not in known}
                places |= {name: centre_0[row] for name, row in known.items() if name not in rows}
                near = [name for name, at in places.items() if np.hypot(*(at - centre[rows[ego]])) < self.sight_m]
                self.surprises += [(actors.time_s, name) for name in near]
        self._find_touches(actors, centre, np.flatnonzero(drives))
        self._before = rows, centre, actors.heading_rad

    @property
    def speed_error(self) -> np.ndarray:
        """All relative errors of speed, one an observation."""
        return np.concatenate([np.zeros(1), *self.speed_errors])

    def _compare(self, actors: Actors, now: np.ndarray, moved: np.ndarray, heading_0: np.ndarray) -> None:
        turn = (actors.heading_rad[now] - heading_0 + np.pi) % (2 * np.pi) - np.pi
        middle = heading_0 + turn / 2
        sideways = np.abs(moved[:, 1] * np.cos(middle) - moved[:, 0] * np.sin(middle))
        speed = np.hypot(*moved.T) / self.step_s
        reported = np.hypot(actors.speed_mps, actors.lateral_mps)[now]
        goes = np.maximum(speed, reported) > MOVES_MPS
        self.steps += int((~actors.parked[now]).sum())
        self.sideways_m = max(self.sideways_m, float(sideways.max(initial=0.0)))
        self.turn_deg = max(self.turn_deg, float(np.degrees(np.abs(turn)).max(initial=0.0)))
        self.speed_errors.append(
            (np.abs(reported - speed)[goes] / np.maximum(speed, MOVES_MPS)[goes]).astype(np.float32)
        )

    def _find_touches(self, actors: Actors, centre: np.ndarray, wheels: np.ndarray) -> None:
        found = overlaps(centre[wheels], actors.heading_rad[wheels], actors.size[wheels])
        pairs = zip(wheels[found.first].tolist(), wheels[found.second].tolist(), found.depth_m.tolist(), strict=True)
        for i, j, depth in pairs:
            if depth <= self.tolerance_m:
                continue
            one, other = sorted((actors.ids[i], actors.ids[j]))
            touch = self._open.get((one, other))
            if touch is None or actors.time_s - touch.end_s > _FORGETS_S:
                touch = self._open[one, other] = Touch((one, other), actors.time_s, actors.time_s)
                self.touches.append(touch)
            touch.end_s = actors.time_s
            if depth > touch.depth_m:
                touch.depth_m, touch.deepest_s = depth, actors.time_s
                touch.scene = " | ".join(_describe(actors, row) for row in (i, j))


def _describe(actors: Actors, row: int) -> str:
    where = "parked" if actors.parked[row] else actors.lanes[row]
    size = f"{actors.size[row, 0]:.1f}x{actors.size[row, 1]:.1f}"
    x, y = actors.front[row, :2]
    course = f"{np.degrees(actors.heading_rad[row]):.0f} deg, {actors.speed_mps[row]:.1f} m/s"
    return f"{actors.ids[row]} {actors.kinds[row]} {size} on {where} at {x:.1f},{y:.1f} {course}"
