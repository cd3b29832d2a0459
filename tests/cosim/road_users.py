"""Hand-made road users."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim.traffic.actors import Actors


def road_users(
    types: Sequence[str],
    front: np.ndarray | list,
    *,
    sizes: np.ndarray | list | None = None,
    heading_rad: np.ndarray | list | float = 0.0,
    speed_mps: float = 0.0,
    ids: Sequence[str] = (),
    time_s: float = 0.0,
) -> Actors:
    """Actors that hold their course."""
    n = len(types)
    return Actors(
        time_s=time_s,
        ids=tuple(ids) or tuple(f"a{i}" for i in range(n)),
        types=tuple(f"t{i}" for i in range(n)),
        kinds=tuple(types),
        lanes=("lane",) * n,
        front=np.array(front, float).reshape(n, 3),
        heading_rad=np.broadcast_to(np.asarray(heading_rad, float), n).copy(),
        speed_mps=np.full(n, speed_mps),
        acceleration_mps2=np.zeros(n),
        yaw_rate_radps=np.zeros(n),
        size=np.ones((n, 3)) if sizes is None else np.array(sizes, float).reshape(n, 3),
        signals=np.zeros(n, np.int64),
        lane_position_m=np.zeros(n),
        parked=np.zeros(n, bool),
        lateral_mps=np.zeros(n),
        body_pitch_rad=np.zeros(n),
        body_roll_rad=np.zeros(n),
    )
