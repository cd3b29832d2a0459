"""SUMO's floating car data: Parquet from the loop's own simulations, which is written fastest; CSV from users."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars

from cosim.driver_discrepancy.tracks import Tracks, gathered

ATTRIBUTES = ("x", "y", "angle", "speed", "lane")
_DECIMALS = 3


def read_fcd(path: Path) -> Tracks:
    """Trajectories that SUMO wrote (`--fcd-output FILE.parquet`), rounded to three decimals; types are empty.

    Args:
        path: written with `ATTRIBUTES`.
    """
    table = polars.read_parquet(path)
    x, y, angle, speed = (
        np.round(table[f"vehicle_{name}"].to_numpy().astype(float), _DECIMALS) for name in ATTRIBUTES[:-1]
    )
    time_s = np.round(table["timestep_time"].to_numpy().astype(float), _DECIMALS)
    ids = table["vehicle_id"].unique().sort().to_list()
    vehicle = np.asarray(table["vehicle_id"].rank("dense").to_numpy(), int) - 1
    lane = np.array(table["vehicle_lane"].to_list(), dtype=str)
    order = np.lexsort((time_s, vehicle))
    return Tracks(
        ids=tuple(ids),
        types=("",) * len(ids),
        vehicle=vehicle[order],
        time_s=time_s[order],
        place=np.column_stack([x, y])[order],
        speed_mps=speed[order],
        heading_rad=np.angle(np.exp(1j * np.radians(90.0 - angle)))[order],
        lane=lane[order],
    )


def read_fcd_table(path: Path) -> Tracks:
    """Trajectories of a table that SUMO wrote; the separator is a semicolon.

    Args:
        path: written with the attributes x, y, angle, speed, lane, and type if it is needed.
    """
    head, _, body = path.read_bytes().partition(b"\n")
    names = [name.decode().partition("_")[2] for name in head.strip().split(b";")]
    cells = body.replace(b"\r", b"").replace(b"\n", b";").split(b";")
    count = len(cells) // len(names)
    columns = {name: cells[at : count * len(names) : len(names)] for at, name in enumerate(names)}

    def numbers(name: str) -> np.ndarray:
        return np.array(columns[name], dtype="S").astype(float) if count else np.zeros(0)

    def words(name: str) -> np.ndarray:
        return np.array(columns[name], dtype="S").astype(str) if count else np.zeros(0, str)

    return gathered(
        words("id"),
        words("type") if "type" in columns else np.full(count, ""),
        words("lane"),
        numbers("time"),
        np.column_stack([numbers("x"), numbers("y")]),
        numbers("speed"),
        np.angle(np.exp(1j * np.radians(90.0 - numbers("angle")))),
    )
