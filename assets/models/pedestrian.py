"""Pedestrians in mid-stride, and persons that sit."""

from __future__ import annotations

from assets.mesh import Mesh
from assets.models.catalogue import ModelSpec
from assets.models.figure import Outfit, Pose, figure

SEAT_M = 0.46  # height on which persons sit
HIP_BEHIND = 0.29  # of the length: the hips of a person that sits behind the middle of the box
_CROWN_M = 0.135  # above the centre of the head
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


def build_person_sitting(spec: ModelSpec) -> Mesh:
    """Mesh of a person on a seat, hands in the lap (variant 0) or on the seat (variant 1).

    Hips and feet are at the height of a seat whatever the height of `spec`; the trunk makes the difference.
    """
    pelvis, head = SEAT_M + 0.10, spec.height_m - _CROWN_M
    neck = head - 0.175
    hands = (((0.24, 0.09, 0.70), (0.22, -0.10, 0.69)), ((0.10, 0.27, 0.60), (0.28, -0.13, 0.69)))[spec.variant]
    ankles = (((0.41, 0.11, 0.09), (0.36, -0.11, 0.09)), ((0.30, 0.09, 0.09), (0.46, -0.10, 0.09)))[spec.variant]
    return figure(
        Pose(
            pelvis=(0.0, 0.0, pelvis),
            neck=(-0.06, 0.0, neck),
            head=(-0.02, 0.0, head),
            hands=hands,
            ankles=ankles,
            elbow_hint=(-1.0, 0.6, -0.3),
            knee_hint=(0.6, 0.1, 1.0),
            outfit=Outfit(sleeves=spec.variant == 0),
        )
    )
