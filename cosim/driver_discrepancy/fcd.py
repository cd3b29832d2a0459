"""SUMO's floating car data as a table (`--fcd-output FILE.csv`), read in bulk."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cosim.driver_discrepancy.tracks import Tracks, gathered


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
