"""SUMO's state of all road users, as columns that persist from step to step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from operator import itemgetter
from types import ModuleType
from typing import Any

import numpy as np

_Values = Mapping[int, Any]
_NUMBERS = ("speed_mps", "acceleration_mps2", "lane_position_m", "signals")


class Subscriptions:
    """Columns of subscribed values, a row for every road user: vehicles by name, then persons by name.

    Most road users are parked and do not change: their rows are read once, and the order of rows is computed again only
    when a vehicle enters, leaves or parks.

    Args:
        constants: libsumo's constants.

    Attributes:
        ids: n names.
        types: n names of vTypes, as SUMO has them.
        lanes: n names of lanes, empty off the road.
        front: (n, 3) world position of the front bumper's centre [m].
        angle_deg: (n,) clockwise from north.
        numbers: name of a column → (n,) float64 `speed_mps`, `acceleration_mps2`, `lane_position_m`, `signals`.
        parked: (n,) bool.
    """

    def __init__(self, constants: ModuleType) -> None:
        self._lane, self._type = constants.VAR_LANE_ID, constants.VAR_TYPE
        common = (constants.VAR_POSITION3D, constants.VAR_ANGLE, constants.VAR_SPEED)
        driven = (constants.VAR_ACCELERATION, constants.VAR_LANEPOSITION, constants.VAR_SIGNALS)
        self._of_person = itemgetter(*common)
        self._of_vehicle = itemgetter(*common, *driven)
        self._stale = True
        self._lively: tuple[list[str], list[str]] = ([], [])
        self._rows = np.zeros(0, int)
        self.ids: tuple[str, ...] = ()
        self.types: tuple[str, ...] = ()
        self.lanes: list[str] = []
        self.front, self.angle_deg = np.zeros((0, 3)), np.zeros(0)
        self.numbers: dict[str, np.ndarray] = {name: np.zeros(0) for name in _NUMBERS}
        self.parked = np.zeros(0, bool)

    def forget_parked(self) -> None:
        """Read parked vehicles again at the next step, since some have changed."""
        self._stale = True

    def read(
        self, vehicles: Mapping[str, _Values], persons: Mapping[str, _Values], parked: Mapping[str, _Values]
    ) -> bool:
        """Take a step's values; whether the rows are others than before.

        Args:
            vehicles, persons: name → values of those who have some.
            parked: the same for parked vehicles, as last read; they take precedence.
        """
        known_vehicles, known_persons = self._lively
        if self._stale or len(vehicles) != len(known_vehicles) or len(persons) != len(known_persons):
            return self._read_all(vehicles, persons, parked)
        try:
            driven = [vehicles[name] for name in known_vehicles]
            walking = [persons[name] for name in known_persons]
        except KeyError:
            return self._read_all(vehicles, persons, parked)
        self._fill(self._rows, driven, walking)
        lane = self._lane
        for row, one in zip(self._rows.tolist(), [*driven, *walking], strict=True):
            self.lanes[row] = one[lane]
        return False

    def _read_all(
        self, vehicles: Mapping[str, _Values], persons: Mapping[str, _Values], parked: Mapping[str, _Values]
    ) -> bool:
        driven = sorted(vehicles.keys() | parked.keys())
        walking = sorted(persons)
        moved = [parked.get(name) or vehicles[name] for name in driven]
        walked = [persons[name] for name in walking]
        values = [*moved, *walked]
        before, self.ids = self.ids, (*driven, *walking)
        self.types = tuple(one[self._type] for one in values)
        self.lanes = [one[self._lane] for one in values]
        n = len(values)
        self.front, self.angle_deg = np.zeros((n, 3)), np.zeros(n)
        self.numbers = {name: np.zeros(n) for name in _NUMBERS}
        self._fill(np.arange(n), moved, walked)
        self.parked = np.array([name in parked for name in self.ids], bool)
        # Names that are both subscribed and parked make the lists of names differ in length, so they are read again.
        self._lively = [name for name in driven if name not in parked], walking
        self._rows = np.flatnonzero(~self.parked)
        self._stale = False
        return self.ids != before

    def _fill(self, rows: np.ndarray, driven: Sequence[_Values], walking: Sequence[_Values]) -> None:
        """Take values of vehicles, and then of persons, into some rows."""
        position, angle, speed, *more = self._columns(self._of_vehicle, driven, 6)
        on_foot = self._columns(self._of_person, walking, 3)
        if not len(rows):
            return
        self.front[rows] = [*position, *on_foot[0]]
        self.angle_deg[rows] = [*angle, *on_foot[1]]
        self.numbers["speed_mps"][rows] = [*speed, *on_foot[2]]
        for name, column in zip(_NUMBERS[1:], more, strict=True):
            self.numbers[name][rows[: len(driven)]] = column

    @staticmethod
    def _columns(getter: Callable[[_Values], tuple], values: Sequence[_Values], count: int) -> list[tuple]:
        return list(zip(*map(getter, values), strict=True)) if values else [()] * count
