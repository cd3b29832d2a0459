"""The returns of one revolution while effects act on them."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from sensors.hits import NOTHING


@dataclass(frozen=True, eq=False)
class Returns:
    """One row a return, sorted by beam, then by number. Arrays may be shared between tables: never write to them.

    Attributes:
        beam: (m,) int32 rows of the revolution's rays.
        range_m: (m,) float32 measured range from the reported optical centre.
        intensity: (m,) float32; reflectance at first, the reported 0–1 at last.
        reflectance: (m,) float32 reflectance at 905 nm of the surface, never changed by effects.
        normal_code: (m, 2) int16 encoded face normal in world axes.
        material: (m,) uint8 row of the material table.
        instance: (m,) int16 row of the frame's instances, −1 the static world, −2 no surface.
        return_no: (m,) uint8 from 0.
    """

    beam: np.ndarray
    range_m: np.ndarray
    intensity: np.ndarray
    reflectance: np.ndarray
    normal_code: np.ndarray
    material: np.ndarray
    instance: np.ndarray
    return_no: np.ndarray

    def __len__(self) -> int:
        return len(self.beam)

    @classmethod
    def spurious(
        cls, beam: np.ndarray, range_m: np.ndarray, intensity: np.ndarray, material: np.ndarray | int = 0
    ) -> Returns:
        """Returns of `beam` (m,) that are not from a surface."""
        n = len(beam)
        return cls(
            beam=np.asarray(beam, np.int32),
            range_m=np.asarray(range_m, np.float32),
            intensity=np.asarray(intensity, np.float32),
            reflectance=np.zeros(n, np.float32),
            normal_code=np.zeros((n, 2), np.int16),
            material=np.broadcast_to(np.asarray(material, np.uint8), n).copy(),
            instance=np.full(n, NOTHING, np.int16),
            return_no=np.zeros(n, np.uint8),
        )

    def take(self, rows: np.ndarray) -> Returns:
        """The returns at `rows`: indices or a mask."""
        if rows.dtype == bool:
            rows = np.flatnonzero(rows)
        return Returns(*(getattr(self, field.name).take(rows, axis=0) for field in fields(self)))

    def merged(self, other: Returns) -> Returns:
        """Both tables in order of beam and return number."""
        own, theirs = self._place(), other._place()
        order = np.argsort(theirs, kind="stable")
        at = np.searchsorted(own, theirs[order], side="right")
        rows = np.insert(np.arange(len(self)), at, len(self) + order)
        columns = [np.concatenate([getattr(self, f.name), getattr(other, f.name)]) for f in fields(self)]
        return Returns(*columns).take(rows)

    def replacing_beams(self, other: Returns) -> Returns:
        """`other`, and of this table the returns of beams that `other` has none of."""
        if not len(other):
            return self
        if not len(self):
            return self.merged(other)
        if self._one_a_beam and other._one_a_beam:
            return self._overwritten(other)
        replaced = np.zeros(max(self.beam.max(), other.beam.max()) + 1, bool)
        replaced[other.beam] = True
        return self.take(~replaced[self.beam]).merged(other)

    @property
    def _one_a_beam(self) -> bool:
        return bool((np.diff(self.beam) > 0).all())

    def _overwritten(self, other: Returns) -> Returns:
        """`replacing_beams` of tables with one return a beam."""
        row = np.minimum(np.searchsorted(self.beam, other.beam), len(self) - 1)
        found = self.beam[row] == other.beam
        rows = np.arange(len(self))
        rows[row[found]] = len(self) + np.flatnonzero(found)
        new = np.flatnonzero(~found)
        rows = np.insert(rows, np.searchsorted(self.beam, other.beam[new]), len(self) + new)
        columns = [np.concatenate([getattr(self, f.name), getattr(other, f.name)]) for f in fields(self)]
        return Returns(*columns).take(rows)

    def _place(self) -> np.ndarray:
        """(m,) what tables are sorted by: beam, then number of the return."""
        return self.beam.astype(np.int64) * 256 + self.return_no
