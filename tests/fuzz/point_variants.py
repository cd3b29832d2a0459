"""Variants of scans whose truth is known: formats, columns, units, clocks, order, axes, outliers, no returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from cosim.recordings import open_recording
from tests.fuzz.variants import Trial

SCANS, _LASERS, _FIRINGS, _SWEEP_S = 3, 16, 360, 0.1
_INTENSITY = {"0-1": 1.0, "0-255": 255.0, "0-100": 100.0, "16 bit": 65535.0}
_CLOCKS = {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "ns": 1e-9}
_AXES = {
    "x,y,z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "x,-y,z": ((1, 0, 0), (0, -1, 0), (0, 0, 1)),
    "x,y,-z": ((1, 0, 0), (0, 1, 0), (0, 0, -1)),
    "x,-y,-z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    "-y,-z,x": ((0, -1, 0), (0, 0, -1), (1, 0, 0)),
}


@dataclass
class Points:
    """Columns of a scan that are stored, and what reading them must give.

    Attributes:
        true: (n, 3) points in the sensor's axes [m].
        returns: (n,) bool: rows that are returns.
        stray, dark: (n,) bool: rows whose time, or intensity, shows that they are not returns.
        columns: (n,) stored values by name, in the order of the file.
        ring: (n,) laser numbers.
        time_s: (n,) firing times.
        intensity: (n,) in 0–1.
    """

    true: np.ndarray
    returns: np.ndarray
    ring: np.ndarray
    time_s: np.ndarray
    intensity: np.ndarray
    columns: dict[str, np.ndarray] = field(default_factory=dict)
    stray: np.ndarray = field(init=False)
    dark: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.stray, self.dark = np.zeros((2, len(self.true)), bool)

    def reorder(self, rows: np.ndarray) -> None:
        """Keep these rows in this order."""
        for name in ("true", "returns", "ring", "time_s", "intensity"):
            setattr(self, name, getattr(self, name)[rows])


@lru_cache(maxsize=16)
def _street(number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points, lasers, times and reflectances of a scan in a street, firing by firing, clockwise.

    The street has unequal distances to both sides, bays and houses of other heights, so that no symmetry maps it onto
    itself.
    """
    scene, step = divmod(number, SCANS)
    rng, shape = np.random.default_rng(number), np.random.default_rng(1000 + scene)
    mount_m, low_deg, high_deg = shape.uniform(1.3, 2.4), shape.uniform(-25, -14), shape.uniform(2, 15)
    column = np.pi - 2 * np.pi * (np.arange(_FIRINGS) + 0.5) / _FIRINGS
    azimuth = np.repeat(column, _LASERS)
    ring = np.tile(np.arange(_LASERS), _FIRINGS)
    elevation = np.tile(np.radians(np.linspace(high_deg, low_deg, _LASERS)), _FIRINGS)
    way = np.column_stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(way[:, 2] < 0, -mount_m / way[:, 2], np.inf)
        for side_m in (shape.uniform(5, 9), -shape.uniform(7, 14)):
            wall = np.where(way[:, 1] * side_m > 0, side_m / way[:, 1], np.inf)
            along = 2.0 * step + wall * way[:, 0]
            wall = wall - np.abs(side_m) * 0.1 * (np.mod(along, 11.0) < 3.0)
            reach = np.minimum(reach, np.where(wall * way[:, 2] < shape.uniform(4, 9), wall, np.inf))
    keep = reach < shape.uniform(50, 90)
    reach = reach[keep] + rng.normal(0, 0.01, keep.sum())
    time = (np.pi - azimuth[keep]) / (2 * np.pi) * _SWEEP_S
    return way[keep] * reach[:, None], ring[keep], time, rng.beta(1.5, 4, keep.sum())


def draw_scans(rng: np.random.Generator) -> list[Points]:
    """The scans of a street, as a sensor fires."""
    scene = int(rng.integers(4))
    scans = []
    for number in range(scene * SCANS, (scene + 1) * SCANS):
        xyz, ring, time, intensity = (each.copy() for each in _street(number))
        scans.append(Points(xyz, np.ones(len(xyz), bool), ring, time, intensity))
    return scans


def store(scans: list[Points], rng: np.random.Generator, drawn: list[str]) -> tuple[str, bool]:
    """Fill the stored columns in a way drawn at random.

    Returns the format, and whether columns have names.
    """
    suffix = str(rng.choice([".bin", ".npy", ".npz", ".pcd", ".ply"], p=[0.5, 0.1, 0.1, 0.2, 0.1]))
    named = suffix not in (".bin", ".npy")
    axes = str(rng.choice(list(_AXES), p=[0.75, 0.1, 0.05, 0.05, 0.05]))
    metres = float(rng.choice([1.0, 0.01, 0.001], p=[0.85, 0.05, 0.1]))
    order = str(rng.choice(["firing", "laser", "laser, upwards", "shuffled"], p=[0.5, 0.2, 0.15, 0.15]))
    bright = str(rng.choice(list(_INTENSITY)))
    clock, epoch = str(rng.choice(list(_CLOCKS))), float(rng.choice([0.0, 0.0, 1.7e9, 3600.0]))
    extra = [name for name in ("ring", "time", "elongation", "return_no", "zeros") if rng.random() < 0.35]
    has_intensity = named is False or rng.random() < 0.85
    first = bool(rng.random() < 0.5)
    drawn += [suffix, f"axes {axes}", f"{metres:g} m", f"{order} order", f"intensity {bright}" if has_intensity else ""]
    drawn += [f"{', '.join(extra)} {'first' if first else 'last'}", f"clock in {clock} from {epoch:g} s"]
    # A head that turns the other way and a mirrored axis cancel: such a scan cannot be distinguished from a usual one.
    counter_clockwise = bool(rng.random() < 0.05 and np.linalg.det(_AXES[axes]) > 0)
    world = rng.random() < 0.03
    for number, scan in enumerate(scans):
        rows = np.arange(len(scan.true))
        if order == "shuffled":
            rows = rng.permutation(rows)
        elif order.startswith("laser"):
            rows = np.argsort(scan.ring * (-1 if order.endswith("upwards") else 1), kind="stable")
        if counter_clockwise:
            scan.true[:, 1] *= -1  # the mirrored street, seen by a head that turns the other way
        scan.reorder(rows)
        xyz = scan.true @ np.linalg.inv(np.array(_AXES[axes], float)).T / metres
        if world:
            xyz = xyz + np.array([691_000.0, 5_335_000.0, 400.0])
        scan.columns = dict(zip("xyz", xyz.T, strict=True))
        values: dict[str, np.ndarray] = {}
        time = (scan.time_s + epoch + 0.1 * number) / _CLOCKS[clock]
        if epoch == 0.0:
            time = scan.time_s / _CLOCKS[clock]
        values["ring"], values["time"] = scan.ring.astype(float), time
        values["elongation"] = rng.random(len(rows)) * 0.3
        values["return_no"] = (rng.random(len(rows)) < 0.1).astype(float)
        values["zeros"] = np.zeros(len(rows))
        others = {name: values[name] for name in extra}
        # readings that are not intensities come after it, as in all data sets; lasers and times before or after it
        front = {name: value for name, value in others.items() if first and name in ("ring", "time")}
        scan.columns |= front
        if has_intensity:
            scan.columns["intensity"] = scan.intensity * _INTENSITY[bright]
        scan.columns |= {name: value for name, value in others.items() if name not in front}
    drawn += ["counter-clockwise"] * counter_clockwise + ["georeferenced"] * world
    return suffix, named


def spoil_rows(scans: list[Points], rng: np.random.Generator, drawn: list[str]) -> None:
    """Overwrite some rows as sensors and exports do."""
    draw = str(
        rng.choice(
            ["", "origin", "nan", "inf", "minus one", "far", "sphere", "bright", "negative", "stray", "garbage"],
            p=[0.4, *[0.06] * 10],
        )
    )
    drawn.append(draw)
    share = float(rng.choice([0.0005, 0.01, 0.06]))
    for scan in scans:
        rows = rng.random(len(scan.true)) < share
        rows[int(rng.integers(len(rows)))] = True
        xyz = [scan.columns[axis] for axis in "xyz"]
        match draw:
            case "origin" | "minus one" | "nan" | "inf":
                value = {"origin": 0.0, "minus one": -1.0, "nan": np.nan, "inf": np.inf}[draw]
                if draw == "minus one":
                    rows |= rng.random(len(rows)) < 0.02
                for column in xyz:
                    column[rows] = value
                scan.returns &= ~rows
            case "far":
                rows &= np.cumsum(rows) <= 3
                for column in xyz:
                    column[rows] *= 1e5
                scan.returns &= ~rows
            case "sphere":
                rows = rng.random(len(rows)) < 0.1
                true = scan.true[rows] / np.linalg.norm(scan.true[rows], axis=1)[:, None] * 200.0
                scale = np.linalg.norm(np.stack(xyz, 1)[~rows][:1]) / np.linalg.norm(scan.true[~rows][:1])
                stored = np.stack(xyz, 1)[rows]
                stored *= (200.0 * scale / np.linalg.norm(stored, axis=1))[:, None]
                for axis, column in enumerate(xyz):
                    column[rows] = stored[:, axis]
                scan.true[rows] = true
                scan.returns &= ~rows
            case "bright" if "intensity" in scan.columns:
                rows &= np.cumsum(rows) <= 2
                scan.columns["intensity"][rows] *= 300.0
                scan.intensity[rows] = np.nan
            case "negative" if "intensity" in scan.columns:
                scan.columns["intensity"][rows] = -1.0
                scan.returns &= ~rows
                scan.dark |= rows
            case "stray" if "time" in scan.columns:
                rows &= np.cumsum(rows) <= 20
                span = float(np.ptp(scan.columns["time"]))
                scan.columns["time"][rows] = scan.columns["time"].min() + span * float(rng.choice([3.6, -7.0, 1e5]))
                scan.returns &= ~rows
                scan.stray |= rows
            case "garbage":
                rows &= np.cumsum(rows) <= 3
                for column in scan.columns.values():
                    column[rows] = float(rng.choice([1e30, -1e30, np.nan, np.inf]))
                scan.returns &= ~rows


def write(scans: list[Points], folder: Path, suffix: str, rng: np.random.Generator, drawn: list[str]) -> None:
    """Write the stored columns, a file a scan."""
    kind = str(rng.choice(["<f4", ">f4", "<f8"], p=[0.8, 0.1, 0.1])) if suffix in (".bin", ".npy") else "<f4"
    drawn.append(kind)
    writer = {".bin": _raw, ".npy": _array, ".npz": _archive, ".pcd": _pcd, ".ply": _ply}[suffix]
    for old in folder.iterdir():
        old.unlink()
    form = str(rng.choice(["ascii", "binary", "padded"])) if suffix == ".pcd" else kind
    drawn.append(form)
    for number, scan in enumerate(scans):
        writer(folder / f"{number:06d}{suffix}", scan.columns, form)
    if rng.random() < 0.03:
        drawn.append("cut")
        path = folder / f"{len(scans) - 1:06d}{suffix}"
        path.write_bytes(path.read_bytes()[: -int(2 * rng.integers(100) + 1)])


def _raw(path: Path, columns: dict[str, np.ndarray], kind: str) -> None:
    with np.errstate(over="ignore"):
        np.stack(list(columns.values()), 1).astype(kind).tofile(path)


def _array(path: Path, columns: dict[str, np.ndarray], kind: str) -> None:
    with np.errstate(over="ignore"):
        np.save(path, np.stack(list(columns.values()), 1).astype(kind))


def _archive(path: Path, columns: dict[str, np.ndarray], kind: str) -> None:
    stored: dict[str, Any] = dict(columns)
    np.savez(path, **stored)


def _pcd(path: Path, columns: dict[str, np.ndarray], form: str) -> None:
    names, count = list(columns), len(columns["x"])
    head = ["VERSION 0.7", f"FIELDS {' '.join(names)}", f"SIZE {' '.join('8' for _ in names)}"]
    head += [f"TYPE {' '.join('F' for _ in names)}", f"COUNT {' '.join('1' for _ in names)}"]
    table = np.stack(list(columns.values()), 1)
    body = table.astype("<f8").tobytes()
    if form == "ascii":
        body = "\n".join(" ".join(f"{value:.6f}" for value in row) for row in table.tolist()).encode()
    if form == "padded":
        head[1:] = [f"{line} {more}" for line, more in zip(head[1:], ("_", "1", "U", "4"), strict=True)]
        padding = np.zeros((count, 4), np.uint8)
        body = np.hstack([table.astype("<f8").view(np.uint8).reshape(count, -1), padding]).tobytes()
    head += [f"WIDTH {count}", "HEIGHT 1", "VIEWPOINT 0 0 0 1 0 0 0", f"POINTS {count}"]
    head += [f"DATA {'ascii' if form == 'ascii' else 'binary'}"]
    path.write_bytes(("\n".join(head) + "\n").encode() + body)


def _ply(path: Path, columns: dict[str, np.ndarray], kind: str) -> None:
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(columns['x'])}"]
    head += [*(f"property double {name}" for name in columns), "end_header"]
    path.write_bytes(("\n".join(head) + "\n").encode() + np.stack(list(columns.values()), 1).astype("<f8").tobytes())


def find_error(scans: list[Points], folder: Path) -> str | None:
    """How the scans that a recording holds differ from the truth; None where they agree."""
    recording = open_recording(folder)
    if any("left and right cannot be verified" in note for note in recording.notes):
        mirrored = recording[0].xyz * [1, -1, 1]
        if len(mirrored) == scans[0].returns.sum() and np.abs(mirrored - scans[0].true[scans[0].returns]).max() < 0.01:
            return None  # stated as open
    if len(recording) != len(scans):
        return f"{len(recording)} scans of {len(scans)}"
    for truth, scan in zip(scans, recording, strict=True):
        rows = truth.returns | (truth.stray & (scan.time_s is None)) | (truth.dark & (scan.intensity is None))
        if len(scan) != rows.sum():
            return f"{len(scan)} points of {rows.sum()} returns, left out {dict(scan.left_out)}"
        away = np.abs(scan.xyz - truth.true[rows]).max(initial=0.0)
        if away > 0.01:
            return f"points are {away:.3g} m away"
        if scan.ring is not None and not np.array_equal(scan.ring, truth.ring[rows]):
            return "rings differ"
        if scan.time_s is not None:
            late = np.abs(scan.time_s - (truth.time_s[rows] - truth.time_s[rows].min())).max()
            if late > 5e-4:
                return f"times differ by {late:.3g} s"
        if scan.intensity is not None:
            wanted = truth.intensity[rows]
            usable = np.isfinite(wanted) & (wanted > 0.02)
            ratio = scan.intensity[usable] / wanted[usable]
            if not 0.3 < np.median(ratio) < 1.1 or np.ptp(np.quantile(ratio, [0.02, 0.98])) > 0.02:
                return f"intensities are {np.quantile(ratio, [0.02, 0.5, 0.98]).round(3)} times the true ones"
    return None


def point_trial(folder: Path) -> Trial:
    """A trial that writes a variant into a folder and reads it."""
    folder.mkdir(parents=True, exist_ok=True)

    def trial(rng: np.random.Generator, drawn: list[str]) -> str | None:
        scans = draw_scans(rng)
        suffix, _ = store(scans, rng, drawn)
        spoil_rows(scans, rng, drawn)
        write(scans, folder, suffix, rng, drawn)
        return find_error(scans, folder)

    return trial
