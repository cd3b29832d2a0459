"""Buffer of the nearest surface of each ray: its distance, and all other properties in a record of eight bytes."""

from __future__ import annotations

import numpy as np

from sensors.hits import NOTHING, RANGE_STEP_M, Surface
from sensors.normals import encode_normals

RECORD = np.dtype([("normal_code", "<i2", 2), ("instance", "<i2"), ("material", "u1"), ("glass", "?")])
_INSTANCE_SHIFT = np.int64(32)


def face_records(normals: np.ndarray, materials: np.ndarray, glass: np.ndarray, instance: int) -> np.ndarray:
    """Records of a mesh's faces, (m + 1,) int64; the last one, for row −1, is that of a miss.

    Args:
        normals: (m, 3) float32.
        materials: (m,) uint8 rows of the material table.
        glass: (m,) bool.
        instance: of all faces; 0 on a model, whose row `offer_instance` adds.
    """
    records = np.zeros(len(materials) + 1, RECORD)
    faces, nothing = records[:-1], records[-1:]
    faces["normal_code"], faces["instance"] = encode_normals(normals), instance
    faces["material"], faces["glass"] = materials, glass
    nothing["instance"] = NOTHING
    return records.view(np.int64)


class HitBuffer:
    """Nearest surface of each of n rays among those offered so far.

    Attributes:
        distance: (n,) float32, the limit without a surface.
        records: (n,) int64, as `face_records` gives them.
    """

    def __init__(self, distance: np.ndarray, records: np.ndarray) -> None:
        self.distance, self.records = distance, records
        self._normals: list[tuple[np.ndarray, np.ndarray]] = []
        self._rows: list[np.ndarray] = []

    @classmethod
    def nothing(cls, limit: np.ndarray) -> HitBuffer:
        """No surfaces within the limits (n,) float32."""
        record = np.zeros(1, RECORD)
        record["instance"] = NOTHING
        return cls(limit.copy(), np.full(len(limit), record.view(np.int64)[0]))

    @property
    def glass(self) -> np.ndarray:
        """Whether it is a pane, (n,) bool."""
        return self.records.view(RECORD)["glass"]

    def put(self, rays: np.ndarray, distance: np.ndarray, records: np.ndarray) -> None:
        """Set the surfaces (k,) of some rays."""
        self.distance[rays] = distance
        self.records[rays] = records

    def offer(self, rays: np.ndarray, distance: np.ndarray, records: np.ndarray) -> None:
        """Set surfaces (k,), at most one per ray, where they are nearer."""
        nearer = np.flatnonzero(distance < self.distance[rays])
        self.put(rays[nearer], distance[nearer], records[nearer])

    def offer_instance(
        self,
        rays: np.ndarray,
        distance: np.ndarray,
        records: np.ndarray,
        normals: np.ndarray,
        row: np.ndarray | int,
    ) -> None:
        """Like `offer`, of a model's faces with their normals (k, 3).

        Rays may come more than once where `row` (k,) says which of the instances each met.
        """
        nearer = np.flatnonzero(distance < self.distance[rays])
        if isinstance(row, np.ndarray):
            np.minimum.at(self.distance, rays[nearer], distance[nearer])
            nearer = nearer[distance[nearer] == self.distance[rays[nearer]]]
            row = row[nearer]
            self._rows.append(row)
        rays = rays[nearer]
        self.put(rays, distance[nearer], records[nearer] + (np.asarray(row, np.int64) << _INSTANCE_SHIFT))
        self._normals.append((rays, normals.take(nearer, axis=0)))

    def settle(self, turns: np.ndarray | None = None) -> None:
        """Encode the normals of instances, all at once; of several for one ray the last is the nearest.

        Args:
            turns: (m, 3, 3) float32 by instance: what the normals (as rows) are multiplied by to be in world axes,
                where all were offered with an array of rows; None where they are in world axes.
        """
        if self._normals:
            rays, normals = (np.concatenate(column) for column in zip(*self._normals, strict=True))
            if turns is not None:
                normals = np.einsum("ij,ijk->ik", normals, turns.take(np.concatenate(self._rows), axis=0))
            self.records.view(np.int32)[2 * rays] = encode_normals(normals).view(np.int32)[:, 0]
            self._normals.clear()
            self._rows.clear()

    def surface(self, rays: np.ndarray | slice = slice(None)) -> Surface:
        """The surfaces of `rays`, ranges rounded to the stored step."""
        records = self.records[rays]
        record = records.view(RECORD)
        steps = np.rint(self.distance[rays] / np.float32(RANGE_STEP_M))
        steps *= np.float32(RANGE_STEP_M)
        instance = np.ascontiguousarray(record["instance"])
        steps[instance == NOTHING] = np.inf
        return Surface(
            range_m=steps,
            normal_code=records.view(np.int32)[::2].copy().view(np.int16).reshape(-1, 2),
            material=np.ascontiguousarray(record["material"]),
            instance=instance,
        )
