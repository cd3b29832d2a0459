"""Logs of a training: `log.jsonl`, and TensorBoard events if it is installed."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from typing import Any

from cosim.drives.writer import explained


class TrainingLog:
    """One line per logged step or validation; lines of steps that a resumed run repeats are removed.

    Args:
        folder: folder of the training.
        step: step at which the run starts.
    """

    def __init__(self, folder: Path, step: int) -> None:
        self._path = folder / "log.jsonl"
        self._board = _open_tensorboard(folder / "tensorboard", step)
        with explained(self._path):
            entries = [entry for entry in read_log(folder) if entry["step"] <= step]
            self._path.write_text("".join(json.dumps(entry) + "\n" for entry in entries), encoding="utf-8")

    def write(self, step: int, **values: Any) -> None:
        """Add a line; numbers also go to TensorBoard."""
        with explained(self._path), self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"step": step, **values}) + "\n")
        if self._board is not None:
            for name, value in _flatten(values):
                self._board.add_scalar(name, value, step)

    def close(self) -> None:
        """Close the TensorBoard writer."""
        if self._board is not None:
            self._board.close()


def read_log(folder: Path) -> list[dict[str, Any]]:
    """Read the entries of a training's log; an incomplete last line is ignored."""
    path = folder / "log.jsonl"
    if not path.is_file():
        return []
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    return [json.loads(line) for line in lines if line.endswith("\n") and line.strip()]


def _open_tensorboard(folder: Path, step: int) -> Any:
    if importlib.util.find_spec("tensorboard") is None:
        return None
    from torch.utils.tensorboard import SummaryWriter

    return SummaryWriter(str(folder), purge_step=step + 1)


def _flatten(values: dict[str, Any], prefix: str = "") -> list[tuple[str, float]]:
    flat = []
    for name, value in values.items():
        if isinstance(value, dict):
            flat += _flatten(value, f"{prefix}{name}/")
        elif isinstance(value, int | float):
            flat.append((prefix + name, float(value)))
    return flat
