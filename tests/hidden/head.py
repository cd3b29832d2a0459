"""The turning head: a pattern file's nominal beams, and where they truly start and point."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True, eq=False)
class Beams:
    """All beams of a revolution, ring-major, in order of firing.

    Attributes:
        ring, block: (n,) int.
        azimuth: (n,) nominal [rad], −π…π.
        elevation: (n,) nominal [rad].
        time_s: (n,) from the pose time.
        firings, rings: shape of the grid.
        range_m: nearest and farthest range.
    """

    ring: np.ndarray
    block: np.ndarray
    azimuth: np.ndarray
    elevation: np.ndarray
    time_s: np.ndarray
    firings: int
    rings: int
    range_m: tuple[float, float]

    @property
    def direction(self) -> np.ndarray:
        """(n, 3) nominal unit vectors in sensor axes."""
        return unit(self.azimuth, self.elevation)


def nominal_beams(pattern: dict, thin: int = 1) -> Beams:
    """The beams of a pattern file; of every `thin`-th firing only."""
    elevation = np.radians(np.array(pattern["elevation_deg"], float))
    rings, total = len(elevation), int(pattern["firings"])
    column = np.pi - 2 * np.pi * (np.arange(0, total, thin) + 0.5) / total
    firings = len(column)
    fan = np.radians(np.array(pattern.get("azimuth_offset_deg") or np.zeros(rings), float))
    block = np.array(pattern.get("block") or np.zeros(rings), int)
    azimuth = column[None] + fan[:, None]
    azimuth = np.pi - np.mod(np.pi - azimuth, 2 * np.pi)
    time = np.broadcast_to(-column / (2 * np.pi) * float(pattern["sweep_s"]), azimuth.shape)
    ring = np.repeat(np.arange(rings), firings)
    low, high = pattern["range_m"]
    return Beams(
        ring, block[ring], azimuth.ravel(), elevation[ring], time.ravel(), firings, rings, (float(low), float(high))
    )


@dataclass(eq=False)
class Aim:
    """Where beams truly point; effects on rays change it.

    Attributes:
        azimuth, elevation: (n,) true angles in sensor axes [rad].
        centre_z: (n,) height of the true optical centre; the sensor knows it, so it is the reported one, too.
        mount: (4, 4) true sensor axes in the nominal ones.
        body: (4, 4) true ego axes in the nominal ones.
        after: (n,) time since the pose time at which a beam meets the world.
    """

    azimuth: np.ndarray
    elevation: np.ndarray
    centre_z: np.ndarray
    after: np.ndarray
    mount: np.ndarray = field(default_factory=lambda: np.eye(4))
    body: np.ndarray = field(default_factory=lambda: np.eye(4))

    @classmethod
    def nominal(cls, beams: Beams) -> Aim:
        """Everything as reported."""
        zero = np.zeros(len(beams.ring))
        return cls(beams.azimuth.copy(), beams.elevation.copy(), zero.copy(), zero.copy())

    def rays(self, frame: dict) -> tuple[np.ndarray, np.ndarray]:
        """Origins (n, 3) or (3,), and directions (n, 3), in world axes."""
        ego = frame["ego"]
        pose, velocity = np.array(ego["pose"], float), np.array(ego["velocity_mps"], float)
        inside = self.body @ np.array(frame["lidar"]["pose_ego"], float) @ self.mount
        direction = unit(self.azimuth, self.elevation) @ inside[:3, :3].T
        centre = inside[:3, 3] + self.centre_z[:, None] * inside[:3, 2] if self.centre_z.any() else inside[:3, 3]
        direction, centre = direction @ pose[:3, :3].T, centre @ pose[:3, :3].T
        if self.after.any():
            angle = float(ego["yaw_rate_radps"]) * self.after
            direction, centre = _about_z(direction, angle), _about_z(np.broadcast_to(centre, direction.shape), angle)
            centre = centre + self.after[:, None] * velocity
        return centre + pose[:3, 3], direction


def unit(azimuth: np.ndarray, elevation: np.ndarray) -> np.ndarray:
    """(n, 3) unit vectors."""
    level = np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], -1)


def rotation(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> np.ndarray:
    """(4, 4) Rz(yaw)·Ry(pitch)·Rx(roll), angles in radians; pitch > 0 is nose down."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    matrix = np.eye(4)
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    matrix[:3, :3] = about_z @ about_y @ about_x
    return matrix


def _about_z(vectors: np.ndarray, angle: np.ndarray) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = vectors.T
    return np.stack([c * x - s * y, s * x + c * y, z], -1)
