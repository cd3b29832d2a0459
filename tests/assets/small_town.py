"""A hand-made crossroads on a slope: the smallest network with everything the world builder handles."""

import numpy as np

from assets.streets import ParkingBay, StopLine, StreetArea, StreetLane, Streets

_ARM_M, _HALF_M = 80.0, 8.0  # length of an arm, half the junction


def slope(x, y):
    """Lane height in metres: 4 % up to the east and a gentle wave to the north."""
    return 0.04 * x + 1.2 * np.sin(y / 60.0)


def small_town(style="suburb"):
    lanes, stops, bays, outline = [], [], [], []
    for arm in range(4):
        turn = np.array([[np.cos(arm * np.pi / 2), -np.sin(arm * np.pi / 2)],
                         [np.sin(arm * np.pi / 2), np.cos(arm * np.pi / 2)]])  # fmt: skip
        for name, across, use, width, inbound in (
            ("in_1", 1.6, "drive", 3.2, True), ("in_0", 4.2, "sidewalk", 2.0, True),
            ("out_1", -1.6, "drive", 3.2, False), ("out_0", -4.2, "sidewalk", 2.0, False),
        ):  # fmt: skip
            x = np.linspace(_HALF_M, _ARM_M, 10)[:: -1 if inbound else 1]
            line = _raised(np.column_stack([x, np.full(10, across)]) @ turn.T)
            lanes.append(StreetLane(f"{arm}{name}", f"{arm}{name[:-2]}", use, line, width, 13.9, False))
            if use == "drive" and inbound:
                control = ("signal", "stop", "yield", "signal")[arm]
                heading = np.arctan2(*(line[-1] - line[-2])[1::-1])
                stops.append(StopLine(f"{arm}in_1", line[-1], float(heading), control))
        outline += [turn @ [_HALF_M, -5.2], turn @ [_HALF_M, 5.2]]
    lanes.append(_lane("crossing_0", "crossing", [[_HALF_M + 2, -3.2], [_HALF_M + 2, 3.2]], 4.0))
    lanes.append(_lane(":c_0", "drive", [[-_HALF_M, -1.6], [_HALF_M, -1.6]], 3.2, internal=True))
    bays.append(ParkingBay("p", _raised(np.array([[-60.0, -6.2], [-30.0, -6.2]])), 2.0))
    areas = (StreetArea("c", "junction", _raised(np.array(outline))),)
    return Streets("small", tuple(lanes), areas, tuple(bays), tuple(stops), style)


def _lane(name, use, points, width, internal=False):
    return StreetLane(name, name.rsplit("_", 1)[0], use, _raised(np.array(points, float)), width, 8.3, internal)


def _raised(xy):
    return np.column_stack([xy, slope(xy[:, 0], xy[:, 1])])
