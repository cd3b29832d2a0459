"""Rows of a table that are no samples: those that are there twice, and those whose time or place is an outlier."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

_FEWEST = 6  # rows of a road user needed to detect a time outlier
_MOST = 2  # time outliers at each end
_SPIKE, _SPIKE_M = 3.0, 2.0  # distance to and from an outlier, relative to the distance past it
_LONGER = 2.5  # step to a row whose time is compared with its place, relative to the usual step
_FASTER, _FASTER_MPS = 4.0, 5.0  # speeds there, against the usual speed of the road user


def repeated_rows(user: np.ndarray, *values: np.ndarray) -> np.ndarray:
    """(n,) bool: rows equal to an earlier one in road user and all values; NaN equals NaN.

    Args:
        user: (n,) number of the road user of each row.
        values: (n,) each: time, place and what else a row states.
    """
    order = np.lexsort((*values, user))
    same = user[order][1:] == user[order][:-1]
    for value in values:
        before, after = value[order][:-1], value[order][1:]
        same &= (before == after) | (np.isnan(before) & np.isnan(after))
    found = np.zeros(len(user), bool)
    found[order[1:][same]] = True  # lexsort is stable: the first of equal rows stays
    return found


def time_outliers(user: np.ndarray, time: np.ndarray) -> np.ndarray:
    """(n,) bool: rows beyond a pause that is longer than all that the same road user does on its other side.

    At most two rows at each end are outliers; a road user that is absent for long and comes back has more.

    Args:
        user: (n,) number of the road user of each row.
        time: (n,) times in any unit; non-finite values do not count as outliers.
    """
    found = np.zeros(len(user), bool)
    order = np.lexsort((time, user))
    order = order[np.isfinite(time[order])]
    for rows in np.split(order, np.flatnonzero(np.diff(user[order])) + 1):
        if len(rows) < _FEWEST:
            continue
        stamps = time[rows]
        for count in range(_MOST, 0, -1):
            first, last = rows[:count], rows[-count:]
            if stamps[count] - stamps[count - 1] > stamps[-1 - _MOST] - stamps[count]:
                found[first] = True
            if stamps[-count] - stamps[-count - 1] > stamps[-count - 1] - stamps[_MOST]:
                found[last] = True
    return found


def contradicted_times(user: np.ndarray, time_s: np.ndarray, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
    """(n,) bool: first and last rows of road users whose time contradicts their place.

    The step to the neighbour is far longer than usual, and the place is not where the road user would be at this time
    at the velocity of the neighbours.

    Args:
        user: (n,) number of the road user of each row.
        time_s: (n,) times; rows with a non-finite time or position do not count.
        x_m: (n,) places.
        y_m: (n,) places.
    """
    found = np.zeros(len(user), bool)
    for rows in _rows_by_user(user, time_s, x_m, y_m):
        usual = float(np.median(np.diff(time_s[rows])))
        for end, near, next_to_near in (rows[:3], rows[:-4:-1]):
            gap, step = abs(time_s[end] - time_s[near]), abs(time_s[near] - time_s[next_to_near])
            if gap <= _LONGER * usual or not 0 < step <= _LONGER * usual:
                continue
            place, before, after = ((x_m[row], y_m[row]) for row in (end, near, next_to_near))
            expected = np.add(before, np.subtract(before, after) * gap / step)
            found[end] = float(np.hypot(*(expected - place))) > _SPIKE_M + _FASTER_MPS * gap
    return found


def position_outliers(user: np.ndarray, time_s: np.ndarray, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
    """(n,) bool: rows whose place a road user would reach and leave far faster than usual, against the way past it.

    Args:
        user: (n,) number of the road user of each row.
        time_s: (n,) times; rows with a non-finite time or position do not count as outliers.
        x_m: (n,) places.
        y_m: (n,) places.
    """
    found = np.zeros(len(user), bool)
    for rows in _rows_by_user(user, time_s, x_m, y_m):
        position, step_s = np.column_stack([x_m[rows], y_m[rows]]), np.maximum(np.diff(time_s[rows]), 1e-9)
        way = np.linalg.norm(np.diff(position, axis=0), axis=1)
        past = np.linalg.norm(position[2:] - position[:-2], axis=1)
        detour = np.minimum(way[1:], way[:-1])
        speed = np.minimum(way[1:] / step_s[1:], way[:-1] / step_s[:-1])
        usual = float(np.median(way / step_s))
        spike = (detour > _SPIKE * past + _SPIKE_M) & (speed > _FASTER * usual + _FASTER_MPS)
        found[rows[1:-1][spike]] = True
    return found


def _rows_by_user(user: np.ndarray, time_s: np.ndarray, x_m: np.ndarray, y_m: np.ndarray) -> Iterator[np.ndarray]:
    """Rows of each road user with enough finite rows, in order of time."""
    order = np.lexsort((time_s, user))
    order = order[np.isfinite(time_s[order]) & np.isfinite(x_m[order]) & np.isfinite(y_m[order])]
    for rows in np.split(order, np.flatnonzero(np.diff(user[order])) + 1):
        if len(rows) >= _FEWEST:
            yield rows
