"""Pedestrians in mid-stride."""

from __future__ import annotations

from assets.mesh import Mesh
from assets.models.catalogue import ModelSpec
from assets.models.figure import Outfit, Pose, figure

_WALK = Pose(
    pelvis=(0.0, 0.0, 0.925),
    neck=(0.03, 0.0, 1.45),
    head=(0.06, 0.0, 1.625),
    hands=((-0.20, 0.285, 0.94), (0.27, -0.275, 1.02)),
    ankles=((0.24, 0.09, 0.125), (-0.26, -0.09, 0.175)),
    toes_deg=(14.0, -32.0),
)
_STROLL = Pose(
    pelvis=(0.0, 0.0, 0.93),
    neck=(0.02, 0.0, 1.46),
    head=(0.045, 0.0, 1.63),
    hands=((0.20, 0.275, 1.00), (-0.12, -0.285, 0.92)),
    ankles=((-0.26, 0.08, 0.17), (0.24, -0.08, 0.12)),
    toes_deg=(-30.0, 12.0),
    elbow_hint=(-1.0, 0.5, -0.2),
    outfit=Outfit(skirt=True, backpack=True, sleeves=False),
)


def build_pedestrian(spec: ModelSpec) -> Mesh:
    """Mesh of a walking person of about 1.76 m; the caller scales it to `spec`."""
    return figure((_WALK, _STROLL)[spec.variant])
