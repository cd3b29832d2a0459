"""Traces of the nominal beams, kept on disk: most hidden effects act on the same hits."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.hidden.head import Aim, Beams
from tests.hidden.twin_tracing import Surfaces, Twin

_FIELDS = ("distance", "cos", "normal", "material", "instance")


class Traces:
    """What the nominal beams of each frame meet.

    Args:
        twin: the world.
        beams: nominal beams.
        folder: where traces are kept; None keeps nothing.
    """

    def __init__(self, twin: Twin, beams: Beams, folder: Path | None = None) -> None:
        self._twin, self._beams, self._folder = twin, beams, folder

    def of(self, frame: dict) -> tuple[Surfaces, Surfaces]:
        """First solid surface and first pane of one frame."""
        path = self._folder / f"{frame['frame']}.npz" if self._folder else None
        if path is not None and path.exists():
            with np.load(path) as kept:
                solid, pane = (Surfaces(*(kept[f"{kind}_{name}"] for name in _FIELDS)) for kind in ("solid", "pane"))
                return solid, pane
        aim = Aim.nominal(self._beams)
        found = self._twin.cast(frame, *aim.rays(frame), aim.after, self._beams.range_m)
        if path is not None:
            self._keep(path, found)
        return found

    @staticmethod
    def _keep(path: Path, found: tuple[Surfaces, Surfaces]) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(".part.npz")
        arrays = zip(("solid", "pane"), found, strict=True)
        np.savez(part, **{f"{kind}_{name}": getattr(s, name) for kind, s in arrays for name in _FIELDS})
        part.replace(path)
