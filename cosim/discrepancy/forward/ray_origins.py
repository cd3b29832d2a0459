"""Where beams really leave from, and which way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sensors.beams import Beams
from sensors.motion import EgoMotion, yaw_matrices


def leaving(
    beams: Beams, egos: Sequence[EgoMotion], lidar_poses: Sequence[np.ndarray], frame: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """True optical centres and directions, (n, 3) float64 world axes, and instants (n,) [s] from the pose time.

    Args:
        beams: of one frame or several, as effects left them.
        egos: the vehicle at the pose time of each frame.
        lidar_poses: (4, 4) nominal world poses of the LiDAR at the pose times.
        frame: (n,) int row of each beam's frame.
    """
    time_s = np.full(len(beams.rays), beams.delay_s)
    if beams.firing_s is not None:
        time_s += beams.firing_s
    sensor = np.stack(
        [
            ego.pose @ beams.body @ np.linalg.solve(ego.pose, pose) @ beams.mount
            for ego, pose in zip(egos, lidar_poses, strict=True)
        ]
    )
    place = np.stack([ego.pose[:3, 3] for ego in egos])
    turn = sensor[frame, :3, :3]
    direction = np.einsum("nij,nj->ni", turn, beams.direction)
    arm = np.einsum("nij,nj->ni", turn, beams.origin) + (sensor[:, :3, 3] - place)[frame]
    origin = place[frame] + arm
    if time_s.any():
        onward = yaw_matrices(np.array([ego.yaw_rate_radps for ego in egos])[frame] * time_s)
        direction = np.einsum("nij,nj->ni", onward, direction)
        velocity = np.stack([np.asarray(ego.velocity_mps, float) for ego in egos])
        origin = place[frame] + time_s[:, None] * velocity[frame] + np.einsum("nij,nj->ni", onward, arm)
    return origin, direction, time_s
