"""Where beams really leave from, and which way."""

from __future__ import annotations

import numpy as np

from sensors.beams import Beams
from sensors.motion import EgoMotion, yaw_matrices


def leaving(beams: Beams, ego: EgoMotion, lidar_pose: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """True optical centres and directions, (n, 3) float64 world axes, and instants (n,) [s] from the pose time.

    Args:
        beams: as effects left them.
        ego: the vehicle at the pose time.
        lidar_pose: (4, 4) nominal world pose of the LiDAR at the pose time.
    """
    time_s = np.full(len(beams.rays), beams.delay_s)
    if beams.firing_s is not None:
        time_s += beams.firing_s
    sensor = ego.pose @ beams.body @ np.linalg.solve(ego.pose, lidar_pose) @ beams.mount
    direction = beams.direction @ sensor[:3, :3].T
    arm = beams.origin @ sensor[:3, :3].T + (sensor[:3, 3] - ego.pose[:3, 3])
    if time_s.any():
        turn = yaw_matrices(ego.yaw_rate_radps * time_s)
        direction = np.einsum("nij,nj->ni", turn, direction)
        arm = np.einsum("nij,nj->ni", turn, arm)
    travelled = time_s[:, None] * np.asarray(ego.velocity_mps, float)
    return ego.pose[:3, 3] + travelled + arm, direction, time_s
