"""Column and unit of the time of a table, by plausible rates and by the speeds that the table states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.traffic.trajectories.table_names import declared_unit, documented_rate_hz, named_columns
from cosim.traffic.trajectories.table_options import TableOptions
from cosim.traffic.trajectories.table_steps import TableColumns, TableSteps
from cosim.traffic.trajectories.tracks import TrajectoryError

_UNITS_S = {1.0: "s", 1e-3: "ms", 1e-6: "µs", 1e-9: "ns"}
_SPEEDS = {1.0: "m/s", 1 / 3.6: "km/h", 0.44704: "mph", 0.3048: "ft/s"}
_STEP_S = (0.004, 3.5)  # between samples of one road user
_FASTEST_MPS = 75.0  # 95 % quantile of speeds in traffic
_STANDS_MPS, _TRAFFIC_MPS = 0.05, 3.0  # bounds of the 95 % quantile of speeds too low for traffic
_AGREES = 0.12  # log of the ratio of moved and stated speed
_LOOSELY = 0.25
_EXACTLY = 0.03  # of speeds in another unit than m/s, which only the ratio shows
_RATES_HZ = (1, 2, 2.5, 5, 10, 12.5, 15, 20, 24, 25, 29.97, 30, 50, 60, 100)
_SNAPS = 0.02  # log of the ratio of measured and ordinary rate
_EPOCHS = {1.0: (3e8, 4e9), 1e-3: (3e11, 4e12), 1e-6: (3e14, 4e15), 1e-9: (3e17, 4e18)}  # 1979 to 2096


def _speed_units(columns: Mapping[str, str], options: TableOptions) -> dict[float, str]:
    if options.speed_unit_mps is not None:
        return {options.speed_unit_mps: f"{options.speed_unit_mps:g} m/s"}
    role = "speed" if "speed" in columns else "vx"
    declared = declared_unit(role, columns[role]) if role in columns else None
    return _SPEEDS if declared is None else {declared: _SPEEDS.get(declared, f"{declared:g} m/s")}


@dataclass(frozen=True)
class _Reading:
    """One way to read the time, and what it makes of the table."""

    column: str
    unit_s: float
    speed_unit: float
    step_s: float
    fast_mps: float
    ratio: float | None

    @property
    def is_plausible(self) -> bool:
        return _STEP_S[0] <= self.step_s <= _STEP_S[1] and self.fast_mps <= _FASTEST_MPS

    def misfit(self) -> float:
        return 0.0 if self.ratio is None else abs(float(np.log(self.ratio)))

    def describe(self) -> str:
        unit = _UNITS_S.get(self.unit_s, f"{self.unit_s:g} s")
        fast = f"95 % of road users below {self.fast_mps:.3g} m/s"
        return f"{self.column} in {unit}: a sample every {self.step_s:.3g} s, {fast}"


def infer_time(
    table: TableColumns,
    columns: Mapping[str, str],
    options: TableOptions,
    source: str,
    x: np.ndarray,
    y: np.ndarray,
    stated: np.ndarray | None,
    notes: list[str],
) -> tuple[str, float, float]:
    """Column of the time, its unit [s] and that of speeds [m/s]."""
    units = _speed_units(columns, options) if stated is not None else {1.0: "m/s"}
    first_unit = next(iter(units))
    if "time" in options.columns and (options.time_unit_s or options.frame_rate_hz):
        unit = options.time_unit_s or 1 / float(options.frame_rate_hz or 1)
        return options.columns["time"], unit, first_unit
    names = [options.columns["time"]] if "time" in options.columns else named_columns(table.header, "time")
    readings: list[_Reading] = []
    for name in names:
        declared = options.time_unit_s or declared_unit("time", name)
        for unit in [declared] if declared else list(_UNITS_S):
            readings += _readings(table, name, unit, x, y, stated, units)
    chosen = _agreeing(readings)
    if chosen is not None:
        _check_epoch(table, chosen, source)
        _check_counter(table, chosen, source)
        _note_time(chosen, units, stated is not None, notes)
        return chosen.column, chosen.unit_s, chosen.speed_unit
    if readings and (len(table.values[names[0]]) < 2 or all(reading.step_s == 0 for reading in readings)):
        return names[0], readings[0].unit_s, first_unit  # one sample a road user: nothing depends on the unit
    frames = named_columns(table.header, "frame")
    counted = _counted(table, frames[0], options, source, x, y, stated, units, notes) if frames else None
    if names and (counted is None or stated is None):
        raise _contradiction(table, names, readings, stated, source, x, y)
    if counted is None:
        raise TrajectoryError(
            f"{source}: the only clock is the counter {frames[0]}, and there are no speeds to infer the frame "
            f"interval from; state it in {source}.yaml, as `frame_rate_hz: 25`"
        )
    if names:
        notes.append(
            f"time from {counted[0]}: read as {', '.join(names)}, road users would not move at the speeds that the "
            f"table states"
        )
    return counted


def _readings(
    table: TableColumns,
    name: str,
    unit_s: float,
    x: np.ndarray,
    y: np.ndarray,
    stated: np.ndarray | None,
    speed_units: Mapping[float, str],
) -> list[_Reading]:
    steps = TableSteps.of(table.user, table.values[name] * unit_s, x, y)
    if not len(steps):
        return [_Reading(name, unit_s, next(iter(speed_units)), 0.0, 0.0, None)]
    step_s = float(np.median(steps.dt))
    fast = float(np.quantile(steps.way / steps.dt, 0.95))
    ratio = None if stated is None else steps.speed_ratio(stated)
    return [_Reading(name, unit_s, unit, step_s, fast, None if ratio is None else ratio / unit) for unit in speed_units]


def _agreeing(readings: Sequence[_Reading]) -> _Reading | None:
    """Return the first plausible reading that the given speeds confirm; more likely units come first."""
    plausible = [reading for reading in readings if reading.is_plausible and reading.step_s > 0]
    for limit in (_AGREES, _LOOSELY):
        for reading in plausible:
            if reading.misfit() <= (limit if reading.speed_unit == 1.0 else _EXACTLY):
                return reading
    return None


def _check_counter(table: TableColumns, reading: _Reading, source: str) -> None:
    """Raise an error if a column read as seconds rises by whole numbers and speeds are implausible for traffic.

    A counter of frames looks like this, and without stated speeds no other clue excludes it.
    """
    if reading.ratio is not None or reading.unit_s != 1.0 or declared_unit("time", reading.column) is not None:
        return
    values = table.values[reading.column]
    whole = bool(np.all(values[np.isfinite(values)] % 1 == 0))
    if whole and _STANDS_MPS < reading.fast_mps < _TRAFFIC_MPS:
        raise TrajectoryError(
            f"{source}: {reading.column} holds whole numbers; as seconds, 95 % of road users are slower than "
            f"{reading.fast_mps:.2g} m/s, as frames of 0.04 s they reach {reading.fast_mps * 25:.2g} m/s, and no "
            f"speeds in the table decide; state the unit in {source}.yaml, as `time_unit_s: 0.04` or `time_unit_s: 1`"
        )


def _check_epoch(table: TableColumns, reading: _Reading, source: str) -> None:
    """Raise where the size of the stamps, as seconds since 1970, says another unit than their steps."""
    typical = float(np.nanmedian(np.abs(table.values[reading.column])))
    other = next((unit for unit, (low, high) in _EPOCHS.items() if low <= typical <= high), None)
    low, high = _EPOCHS.get(reading.unit_s, (0.0, np.inf))
    if other is None or other == reading.unit_s or low <= typical <= high or typical < _EPOCHS[1.0][0] * 10:
        return
    raise TrajectoryError(
        f"{source}: steps and speeds say that {reading.describe()}; but stamps of {typical:.3g} are {_UNITS_S[other]} "
        f"since 1970; state the unit in {source}.yaml, as `time_unit_s: {reading.unit_s:g}`"
    )


def _note_time(reading: _Reading, speed_units: Mapping[float, str], has_speeds: bool, notes: list[str]) -> None:
    unit = _UNITS_S.get(reading.unit_s, f"{reading.unit_s:g} s")
    by = "the speeds stated" if reading.ratio is not None else "ordinary rates and speeds"
    notes.append(f"time is {reading.column} in {unit}, a sample every {reading.step_s:.3g} s: agrees with {by}")
    if has_speeds and reading.speed_unit != 1.0 and reading.ratio is not None:
        notes.append(f"speeds are in {speed_units[reading.speed_unit]}, as road users move")


def _counted(
    table: TableColumns,
    name: str,
    options: TableOptions,
    source: str,
    x: np.ndarray,
    y: np.ndarray,
    stated: np.ndarray | None,
    speed_units: Mapping[float, str],
    notes: list[str],
) -> tuple[str, float, float] | None:
    """Time from a counter of frames: by a stated or documented rate, or by the speeds that the table states."""
    unit = next(iter(speed_units))
    steps = TableSteps.of(table.user, table.values[name], x, y)
    ratio = None if stated is None else steps.speed_ratio(stated)
    if options.frame_rate_hz is not None:
        return name, 1 / options.frame_rate_hz, unit
    measured = None if ratio is None else ratio / unit
    documented = documented_rate_hz(table.header)
    if documented is not None:
        if measured is not None and abs(np.log(measured * documented)) > _LOOSELY:
            raise TrajectoryError(
                f"{source}: {name} counts tenths of a second in Argoverse 2, but by the speeds in the table a frame "
                f"lasts {measured:.4g} s; state it in {source}.yaml, as `frame_rate_hz: {1 / measured:.3g}`"
            )
        notes.append(f"time is {name} at {documented:g} Hz, as Argoverse 2 documents it")
        return name, 1 / documented, unit
    if measured is None:
        return None
    rate = min(_RATES_HZ, key=lambda rate: abs(np.log(measured * rate)))
    snapped = abs(np.log(measured * rate)) < _SNAPS
    interval = 1 / rate if snapped else measured
    if not snapped or not _STEP_S[0] <= interval * float(np.median(steps.dt)) <= _STEP_S[1]:
        raise TrajectoryError(
            f"{source}: by the speeds in the table one step of {name} lasts {interval:.3g} s, which is no ordinary "
            f"rate of recording; state it in {source}.yaml, as `frame_rate_hz: 25`, or `speed_unit_mps: 0.27778` where "
            "speeds are km/h"
        )
    notes.append(f"time is {name} at {1 / interval:.4g} Hz, by how far road users move at the speeds stated")
    return name, interval, unit


def _contradiction(
    table: TableColumns,
    names: Sequence[str],
    readings: Sequence[_Reading],
    stated: np.ndarray | None,
    source: str,
    x: np.ndarray,
    y: np.ndarray,
) -> TrajectoryError:
    """The error that states what was tried, and what would agree."""
    tried = [reading for reading in readings if reading.speed_unit == readings[0].speed_unit]
    plausible = [reading for reading in tried if reading.is_plausible] or tried
    report = "; ".join(reading.describe() for reading in plausible[:4])
    if stated is None or plausible[0].ratio is None:
        others = [unit for unit in _UNITS_S if _readings(table, names[0], unit, x, y, None, {1.0: ""})[0].is_plausible]
        remedy = f"it would be plausible in {_UNITS_S[others[0]]}: " if others else ""
        unit = others[0] if others else 0.04
        return TrajectoryError(
            f"{source}: no reading of the time is plausible ({report}); samples lie {_STEP_S[0]:g} to {_STEP_S[1]:g} s "
            f"apart and traffic is slower than {_FASTEST_MPS:g} m/s; {remedy}state the unit in {source}.yaml, as "
            f"`time_unit_s: {unit:g}`"
        )
    ratio = plausible[0].ratio
    usual = float(np.nanmedian(stated[stated > 0])) if (stated > 0).any() else 0.0
    other = [
        unit
        for unit in _UNITS_S
        for reading in _readings(table, plausible[0].column, unit, x, y, stated, {plausible[0].speed_unit: ""})
        if reading.is_plausible and reading.misfit() <= _LOOSELY
    ]
    if other:
        remedy = f"read in {_UNITS_S[other[0]]} it agrees: `time_unit_s: {other[0]:g}`"
    elif abs(np.log(ratio * 0.3048)) < _AGREES:
        remedy = "positions in feet would agree: `metres: 0.3048`"
    elif abs(np.log(ratio * 0.01)) < _AGREES:
        remedy = "positions in centimetres would agree: `metres: 0.01`"
    else:
        unit_s, unit_mps = plausible[0].unit_s * ratio, plausible[0].speed_unit * ratio
        remedy = f"`time_unit_s: {unit_s:.4g}` or `speed_unit_mps: {unit_mps:.4g}`"
    return TrajectoryError(
        f"{source}: with {report}, road users move {ratio:.3g} times as fast as the {usual:.3g} that the table states; "
        f"state what is right in {source}.yaml ({remedy})"
    )
