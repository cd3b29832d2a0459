"""Point clouds as a LiDAR reports them."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from sensors.hits import Hits


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Returns of one revolution, ring-major, in LiDAR axes.

    Attributes:
        xyz: (n, 3) float32 [m].
        intensity: (n,) float32, 0–1.
        ring: (n,) uint8.
        azimuth: (n,) float32 nominal beam azimuth [rad].
        time_s: (n,) float32 firing time from the pose time.
        return_no: (n,) uint8 from 0.
        instance: (n,) int16 as in `Surface`; never shown to a detector.
        material: (n,) uint8 as in `Surface`; never shown to a detector.
    """

    xyz: np.ndarray
    intensity: np.ndarray
    ring: np.ndarray
    azimuth: np.ndarray
    time_s: np.ndarray
    return_no: np.ndarray
    instance: np.ndarray
    material: np.ndarray

    def __len__(self) -> int:
        return len(self.xyz)

    def in_file_order(self) -> PointCloud:
        """Sort the points as in KITTI's files: by laser from the top, counter-clockwise from straight ahead.

        Tools that recover lasers from the wrap of the azimuth, as LeGO-LOAM does, rely on it.
        """
        turn = self.azimuth + np.float32(2 * np.pi) * (self.azimuth < 0)  # `np.mod` takes five times as long
        bits = turn.view(np.uint32).astype(np.uint64)  # of positive floats, which sort as numbers
        key = self.ring.astype(np.uint64) << np.uint64(40) | bits << np.uint64(8) | self.return_no
        order = np.argsort(key, kind="stable")  # runs of descending azimuth, which a stable sort only reverses
        return PointCloud(*(getattr(self, field.name).take(order, axis=0) for field in fields(self)))

    @property
    def kitti(self) -> np.ndarray:
        """x y z intensity, (n, 4) float32: the rows of a velodyne file."""
        rows = np.empty((len(self), 4), np.float32)
        rows[:, :3], rows[:, 3] = self.xyz, self.intensity
        return rows


def bare_returns(hits: Hits) -> PointCloud:
    """The points of a sensor without effects: every first solid surface, intensity its reflectance."""
    rays, solid = hits.rays, hits.solid
    beams = np.flatnonzero(solid.exists)
    xyz = scaled(rays.direction.take(beams, axis=0), solid.range_m.take(beams))
    if not rays.one_centre:
        xyz += rays.origin.take(beams, axis=0)
    return PointCloud(
        xyz=xyz,
        intensity=hits.reflectance(solid).take(beams),
        ring=rays.ring.take(beams),
        azimuth=rays.azimuth.take(beams),
        time_s=rays.time_s.take(beams),
        return_no=np.zeros(len(beams), np.uint8),
        instance=solid.instance.take(beams),
        material=solid.material.take(beams),
    )


def scaled(vectors: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Vectors (n, 3), each multiplied by its own length (n,), in place: columns are long, rows are short."""
    for column in vectors.T:
        column *= lengths
    return vectors
