"""Tracks in a table (CSV, Parquet, Feather): the traffic loop's, SUMO's, and those of data sets.

Argoverse 1 and 2 (Chang et al., CVPR 2019; Wilson et al., NeurIPS 2021), Waymo Open Motion (Ettinger et al., ICCV 2021)
and INTERACTION (Zhan et al., 2019) give the middle of the body; the traffic loop's table and SUMO's
(`--fcd-output FILE.csv`) the middle of the front bumper. `table_schema.py` infers units, clocks and angles.
"""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cosim.traffic.trajectories.kinds import sumo_types, user_of
from cosim.traffic.trajectories.riders import is_rider
from cosim.traffic.trajectories.table_heading import turned
from cosim.traffic.trajectories.table_names import is_sumo_table, named_columns, needs_numbers
from cosim.traffic.trajectories.table_options import TableOptions, read_table_options
from cosim.traffic.trajectories.table_rows import contradicted_times, position_outliers, repeated_rows, time_outliers
from cosim.traffic.trajectories.table_schema import TableSchema, infer_table_schema
from cosim.traffic.trajectories.table_steps import TableColumns
from cosim.traffic.trajectories.tracks import RoadTracks, TrackSample, TrajectoryError, User, gather

_FALSE = frozenset({"0", "0.0", "false", ""})
_NO_TYPE = "car"
_COLUMNAR = (".parquet", ".feather")
_FASTEST_MPS, _WIDEST_RAD, _LONGEST_M = 90.0, 4 * np.pi + 0.01, 40.0  # what lies beyond is no measurement


def read_table(path: Path, type_files: Iterable[Path], left_out: Counter[str]) -> RoadTracks:
    """Tracks of a CSV file; types that are no road user are counted in `left_out`.

    Raises:
        TrajectoryError: columns are missing, a value is no number, clues about units contradict each other, or see
            `gather`.
        TownError: a file of types cannot be read.
        FormatError: the options file of the table is not YAML.
    """
    options = read_table_options(path)
    header, rows = _rows(path)
    rows = _valid_rows(header, rows, options)
    table = _columns(path, header, rows, options)
    schema = infer_table_schema(table, str(path), options)
    users = _users(header, rows, schema, table, sumo_types(type_files), left_out)
    samples = _samples(header, rows, schema, table)
    sumo = is_sumo_table(header)
    on_foot = [sample.user in users and users[sample.user].kind == "pedestrian" for sample in samples]
    _demand_a_clock(path, schema, table)
    riding = is_rider(samples, on_foot) if sumo else np.zeros(len(samples), bool)
    left, left_notes = _rows_left_out(schema, table)
    kept = [sample for sample, gone in zip(samples, (riding | left).tolist(), strict=True) if not gone]
    tracks = gather(path, kept, users, centred=schema.position == "middle")
    notes = tuple(f"{path}: {note}" for note in (*schema.notes, *left_notes))
    if tracks.undirected:
        notes += (
            f"{path}: {len(tracks.undirected)} road users neither move nor have a heading ({tracks.undirected[0]!r}); "
            "they face east",
        )
    if riding.any():
        riders = {sample.user for sample, rides in zip(samples, riding.tolist(), strict=True) if rides}
        notes += (f"{path}: {int(riding.sum())} samples of {len(riders)} persons riding in vehicles are left out",)
    return replace(tracks, sumo_clock=sumo, notes=notes, inferred=schema.as_dict())


def _demand_a_clock(path: Path, schema: TableSchema, table: TableColumns) -> None:
    """Raise TrajectoryError if all rows have the same time although a road user has several."""
    name = schema.columns["time"]
    time = table.values[name]
    time = time[np.isfinite(time)]
    if len(time) > 1 and not np.ptp(time) and np.bincount(table.user).max() > 1:
        raise TrajectoryError(
            f"{path}: {name} is {time[0]:g} in all rows, so it is not the time; state the column of times in "
            f"{path}.yaml, as `columns: {{time: NAME}}`"
        )


def _users(
    header: Sequence[str],
    rows: list[list[str]],
    schema: TableSchema,
    table: TableColumns,
    known: Mapping[str, User],
    left_out: Counter[str],
) -> dict[str, User]:
    """Road users by id: type of the first row of each, medians of the sizes."""
    at = {role: header.index(name) for role, name in schema.columns.items()}
    sizes = [
        table.values[schema.columns[role]] * schema.length_unit_m if role in at else np.full(len(rows), np.nan)
        for role in ("length", "width", "height")
    ]
    users: dict[str, User] = {}
    first = np.unique(table.user, return_index=True)[1]
    for user, number in enumerate(first.tolist()):
        row = rows[number]
        name = _identifier(row[at["id"]])
        word = _identifier(row[at["type"]]) if "type" in at else _NO_TYPE
        length, width, height = (_usual(size[table.user == user]) for size in sizes)
        user = known.get(word) or known.get(word.partition("@")[0]) or user_of(word, (length, width, height))
        if user is None:
            left_out[word] += 1
        else:
            users[name] = user
    return users


def _samples(
    header: Sequence[str], rows: Sequence[Sequence[str]], schema: TableSchema, table: TableColumns
) -> list[TrackSample]:
    """Every row in SI units and the axes of the town."""

    def column(role: str, unit: float) -> np.ndarray:
        name = schema.columns.get(role)
        return np.full(len(rows), np.nan) if name is None else table.values[name] * unit

    stored = {"x": column("x", schema.metres), "y": column("y", schema.metres)}
    east, north = (stored[axis.strip("-")] * (-1 if axis.startswith("-") else 1) for axis in schema.axes.split(","))
    speed = _within(np.abs(column("speed", schema.speed_unit_mps)), _FASTEST_MPS)
    components = np.hypot(column("vx", schema.speed_unit_mps), column("vy", schema.speed_unit_mps))
    speed = np.where(np.isfinite(speed), speed, _within(components, _FASTEST_MPS))
    heading = turned(_within(column("heading", schema.heading_unit_rad), _WIDEST_RAD), schema.heading_zero)
    time, z = column("time", schema.time_unit_s), column("z", schema.metres)
    lane_at = header.index(schema.columns["lane"]) if "lane" in schema.columns else None
    id_at = header.index(schema.columns["id"])
    values = zip(rows, *(each.tolist() for each in (time, east, north, z, heading, speed)), strict=True)
    return [
        TrackSample(
            t, _identifier(row[id_at]), x, y, up, angle, v, lane="" if lane_at is None else row[lane_at].strip()
        )
        for row, t, x, y, up, angle, v in values
    ]


def _rows_left_out(schema: TableSchema, table: TableColumns) -> tuple[np.ndarray, tuple[str, ...]]:
    """Mask (n,) of the rows that are no samples of their own, and a sentence for each reason."""
    time, x, y = (table.values[schema.columns[role]] for role in ("time", "x", "y"))
    twice = repeated_rows(table.user, time, x, y)
    stray = time_outliers(table.user, time) & ~twice
    unit_s, metres = schema.time_unit_s, schema.metres
    places = x * metres, y * metres
    wrong = contradicted_times(table.user, np.where(twice | stray, np.nan, time * unit_s), *places)
    away = position_outliers(table.user, np.where(twice | stray | wrong, np.nan, time * unit_s), *places)
    left_notes = []
    if twice.any():
        left_notes.append(f"{int(twice.sum())} rows are there twice: one of each is used")
    if stray.any():
        left_notes.append(f"{int(stray.sum())} rows have times far from all others of their road user: left out")
    if wrong.any():
        left_notes.append(f"{int(wrong.sum())} rows have times that contradict their places: left out")
    if away.any():
        left_notes.append(
            f"{int(away.sum())} places are reached and left far faster than the road user moves: left out"
        )
    return twice | stray | wrong | away, tuple(left_notes)


def _usual(sizes: np.ndarray) -> float | None:
    """Median of the sizes that a road user can have; None where there are none."""
    sizes = sizes[(sizes > 0) & (sizes < _LONGEST_M)]
    return float(np.median(sizes)) if len(sizes) else None


def _within(values: np.ndarray, largest: float) -> np.ndarray:
    """Values without those beyond a limit, which are unknown."""
    return np.where(np.abs(values) <= largest, values, np.nan)


def _identifier(text: str) -> str:
    return text.strip().removesuffix(".0")


def is_columnar(path: Path) -> bool:
    """Whether a table is stored by columns: Parquet or Feather."""
    return path.suffix.lower() in _COLUMNAR


def _columnar_rows(path: Path) -> tuple[list[str], list[list[str]]]:
    import polars

    read = {".parquet": polars.read_parquet, ".feather": polars.read_ipc}[path.suffix.lower()]
    try:
        table = read(path)
    except (OSError, polars.exceptions.PolarsError) as error:
        reason = " ".join(str(error).split())
        raise TrajectoryError(f"{path} cannot be read as {path.suffix[1:].title()}: {reason}; copy it again") from error
    cells = ["" if value is None else str(value) for column in table.iter_columns() for value in column.to_list()]
    height = table.height
    return [name.strip() for name in table.columns], [cells[row::height] for row in range(height)] if height else []


def _valid_rows(header: Sequence[str], rows: list[list[str]], options: TableOptions) -> list[list[str]]:
    names = [options.columns["valid"]] if "valid" in options.columns else named_columns(header, "valid")
    if not names or names[0] not in header:
        return rows
    at = header.index(names[0])
    return [row for row in rows if row[at].strip().lower() not in _FALSE]


def _columns(path: Path, header: list[str], rows: list[list[str]], options: TableOptions) -> TableColumns:
    """The numeric columns, and the number of each row's road user."""
    ids = [options.columns["id"]] if "id" in options.columns else named_columns(header, "id")
    at = header.index(ids[0]) if ids and ids[0] in header else None
    names = [_identifier(row[at]) for row in rows] if at is not None else [""] * len(rows)
    number = {name: count for count, name in enumerate(dict.fromkeys(names))}
    values = {
        name: _numbers(path, name, [row[where] for row in rows])
        for where, name in enumerate(header)
        if needs_numbers(name) or name in options.columns.values()
    }
    return TableColumns(tuple(header), np.array([number[name] for name in names], int), values)


def _numbers(path: Path, name: str, cells: list[str]) -> np.ndarray:
    """A column as numbers, NaN where a cell is empty or the column is one of words."""
    found = np.full(len(cells), np.nan)
    wrong = []
    for row, cell in enumerate(cells):
        text = cell.strip()
        if not text:
            continue
        try:
            found[row] = float(text)
        except ValueError:
            wrong.append(row)
    if wrong and (len(wrong) < len(cells) or needs_numbers(name)):
        raise TrajectoryError(
            f"{path}: {name} is {cells[wrong[0]]!r} in row {wrong[0] + 1} below the header; write a number"
        )
    return found


def _rows(path: Path) -> tuple[list[str], list[list[str]]]:
    """Names of the columns, and the cells below them; the separator of CSV is what separates the header best."""
    if is_columnar(path):
        return _columnar_rows(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
        first = text.lstrip().partition("\n")[0]
        separator = max(",;\t", key=first.count)
        lines = [row for row in csv.reader(text.splitlines(), delimiter=separator) if row]
    except UnicodeDecodeError as error:
        raise TrajectoryError(
            f"{path} is not UTF-8 text (byte 0x{error.object[error.start]:02x} at position {error.start}); "
            "save it as CSV in UTF-8"
        ) from error
    except (OSError, csv.Error) as error:
        raise TrajectoryError(f"{path} is no table: {' '.join(str(error).split())}; give CSV with a header") from error
    if not lines:
        raise TrajectoryError(f"{path} is empty; give CSV with a header")
    if "\0" in text or text.lstrip().startswith(("{", "[")):
        form = "binary data" if "\0" in text else "JSON"
        raise TrajectoryError(f"{path} is {form}, not a table; give CSV with a header")
    header = [name.strip() for name in lines[0]]
    double = [name for name, count in Counter(header).items() if count > 1 and name]
    if double:
        raise TrajectoryError(f"{path}: the header has {double[0]!r} more than once; rename one of the columns")
    for number, row in enumerate(lines[1:], 2):
        if len(row) < len(header):
            raise TrajectoryError(f"{path}: line {number} has {len(row)} values, the header {len(header)}")
    return header, lines[1:]
