"""The human figure: limbs, torso and head hung on a few joints."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from assets.mesh import Mesh
from assets.shapes import Vector, box, ellipsoid, loft, tube

THIGH_M, SHIN_M = 0.43, 0.42
UPPER_ARM_M, FOREARM_M = 0.29, 0.26
_FOOT_LENGTH_M = 0.27


@dataclass(frozen=True)
class Outfit:
    """Materials of a figure, and what it wears or carries.

    Attributes:
        top: jacket or shirt.
        legs: trousers.
        sleeves: long sleeves; otherwise bare forearms.
        skirt: a coat or skirt to the knee.
        backpack: carried on the back.
        helmet: `none`, `cycle` or `full`.
    """

    top: str = "clothing"
    legs: str = "clothing_dark"
    sleeves: bool = True
    skirt: bool = False
    backpack: bool = False
    helmet: str = "none"


@dataclass(frozen=True)
class Pose:
    """Joints of a figure of about 1.76 m, metres; left (first) and right points have y > 0 and y < 0.

    Attributes:
        pelvis: middle of the hips.
        neck: base of the neck.
        head: centre of the head.
        hands: left and right wrist.
        ankles: left and right ankle.
        toes_deg: pitch of the left and right foot, toes up.
        elbow_hint: direction elbows point to, for the left arm; mirrored for the right.
        knee_hint: the same for the knees.
        head_pitch_deg: face down positive.
    """

    pelvis: Vector
    neck: Vector
    head: Vector
    hands: tuple[Vector, Vector]
    ankles: tuple[Vector, Vector]
    toes_deg: tuple[float, float] = (0.0, 0.0)
    elbow_hint: Vector = (-1.0, 0.35, -0.2)
    knee_hint: Vector = (1.0, 0.05, 0.1)
    outfit: Outfit = field(default_factory=Outfit)


def figure(pose: Pose) -> Mesh:
    """Mesh of a figure in its pose."""
    outfit = pose.outfit
    pelvis, neck = np.asarray(pose.pelvis, float), np.asarray(pose.neck, float)
    parts = [_torso(pelvis, neck, outfit), _head(pose)]
    spine = (neck - pelvis) / np.linalg.norm(neck - pelvis)
    for side, hand, ankle, toes in zip((1, -1), pose.hands, pose.ankles, pose.toes_deg, strict=True):
        mirror = np.array([1.0, side, 1.0])
        shoulder = neck - 0.055 * spine + np.array([0.0, side * 0.178, 0.0])
        elbow = bend(shoulder, hand, UPPER_ARM_M, FOREARM_M, np.asarray(pose.elbow_hint) * mirror)
        hip = pelvis + np.array([0.0, side * 0.095, -0.02])
        knee = bend(hip, ankle, THIGH_M, SHIN_M, np.asarray(pose.knee_hint) * mirror)
        parts += [_arm(shoulder, elbow, np.asarray(hand, float), outfit)]
        parts += [_leg(hip, knee, np.asarray(ankle, float), outfit.legs), _shoe(ankle, toes)]
    if outfit.skirt:
        parts.append(_skirt(pelvis, pose.ankles, outfit.top))
    if outfit.backpack:
        parts.append(_backpack(pelvis, neck))
    return Mesh.merge(parts)


def bend(start: Vector, end: Vector, first_m: float, second_m: float, hint: Vector) -> np.ndarray:
    """Joint (3,) between two bones that span `start` to `end`, bent towards `hint`; straight if too far."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    reach = np.linalg.norm(end - start)
    axis = (end - start) / reach
    along = np.clip((reach**2 + first_m**2 - second_m**2) / (2 * reach), 0.0, reach)
    aside = np.asarray(hint, float) - axis * (axis @ np.asarray(hint, float))
    aside /= max(float(np.linalg.norm(aside)), 1e-9)
    return start + along * axis + np.sqrt(max(first_m**2 - along**2, 0.0)) * aside


def limb(points: np.ndarray, radii: Vector, material: str, segments: int = 8) -> Mesh:
    """Rounded bar through the joints, its ends drawn in like capsules."""
    points = np.asarray(points, float)
    radii = np.asarray(radii, float)
    first, last = points[0] - points[1], points[-1] - points[-2]
    first, last = first / np.linalg.norm(first), last / np.linalg.norm(last)
    path = np.concatenate([[points[0] + 0.6 * radii[0] * first], points, [points[-1] + 0.6 * radii[-1] * last]])
    return tube(path, np.concatenate([[0.55 * radii[0]], radii, [0.55 * radii[-1]]]), material, segments)


def _arm(shoulder: np.ndarray, elbow: np.ndarray, wrist: np.ndarray, outfit: Outfit) -> Mesh:
    middle = (shoulder + elbow) / 2
    upper = limb(np.stack([shoulder, middle, elbow]), (0.057, 0.052, 0.045), outfit.top)
    lower = limb(
        np.stack([elbow, (elbow + wrist) / 2, wrist]),
        (0.045, 0.042, 0.032),
        outfit.top if outfit.sleeves else "skin",
    )
    ahead = (wrist - elbow) / np.linalg.norm(wrist - elbow)
    hand = ellipsoid((0.045, 0.035, 0.06), wrist + 0.05 * ahead, "skin", 6, 4)
    return Mesh.merge([upper, lower, hand])


def _leg(hip: np.ndarray, knee: np.ndarray, ankle: np.ndarray, material: str) -> Mesh:
    calf = knee + 0.35 * (ankle - knee)
    return limb(np.stack([hip, (hip + knee) / 2, knee, calf, ankle]), (0.098, 0.082, 0.062, 0.062, 0.046), material)


def _shoe(ankle: Vector, toes_deg: float) -> Mesh:
    """Shoe below an ankle: a flat-soled wedge with rounded plan."""
    outline = np.array([(-0.30, -0.75), (0.30, -0.9), (0.66, -0.55), (0.72, 0.0)])
    outline = np.concatenate([outline, (outline * (1, -1))[-2::-1], [(-0.36, 0.0)]])
    plan = outline * (_FOOT_LENGTH_M, 0.052)
    levels = []
    for height, length, width in ((-0.085, 1.0, 1.0), (-0.04, 1.0, 1.0), (0.015, 0.45, 0.8)):
        levels.append(np.column_stack([plan * (length, width), np.full(len(plan), height)]))
    shoe = loft(np.stack(levels), "shoe")
    angle = np.radians(-toes_deg)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    return Mesh(shoe.vertices @ turn.T + np.asarray(ankle), shoe.faces, shoe.materials)


def _sections(centres: np.ndarray, depth: Vector, width: Vector, up: np.ndarray, segments: int) -> np.ndarray:
    """Elliptic rings (s, n, 3) across `up`, counter-clockwise about it; width along y."""
    angle = 2 * np.pi * np.arange(segments) / segments
    forward = np.cross([0.0, 1.0, 0.0], up)
    ring = np.cos(angle)[:, None] * forward * np.asarray(depth)[:, None, None]
    return centres[:, None] + ring + np.sin(angle)[:, None] * np.array([0, 1.0, 0]) * np.asarray(width)[:, None, None]


def _torso(pelvis: np.ndarray, neck: np.ndarray, outfit: Outfit) -> Mesh:
    up = (neck - pelvis) / np.linalg.norm(neck - pelvis)
    share = np.array([-0.17, -0.10, 0.05, 0.30, 0.62, 0.84, 0.95, 1.0])
    depth = (0.06, 0.10, 0.118, 0.108, 0.125, 0.108, 0.085, 0.058)
    width = (0.09, 0.158, 0.172, 0.152, 0.180, 0.195, 0.150, 0.068)
    rings = _sections(pelvis + share[:, None] * (neck - pelvis), depth, width, up, 12)
    trousers = loft(rings[:3], outfit.legs)
    return Mesh.merge([trousers, loft(rings[2:], outfit.top)])


def _head(pose: Pose) -> Mesh:
    neck, head = np.asarray(pose.neck, float), np.asarray(pose.head, float)
    parts = [tube(np.stack([neck - 0.02 * (head - neck), head]), 0.055, "skin", 8)]
    if pose.outfit.helmet == "full":
        shell = ellipsoid((0.135, 0.118, 0.135), head + np.array([0.0, 0, 0.01]), "helmet", 12, 8)
        return Mesh.merge([*parts, shell, box((0.10, 0.17, 0.075), (head[0] + 0.09, 0, head[2] + 0.01), "car_trim")])
    parts.append(ellipsoid((0.098, 0.077, 0.125), head, "skin", 10, 8))
    parts.append(box((0.035, 0.028, 0.045), head + np.array([0.098, 0, -0.015]), "skin"))
    if pose.outfit.helmet == "cycle":
        parts.append(_cap(head + np.array([-0.01, 0, 0.03]), (0.135, 0.102, 0.115), "helmet", 0.0))
    else:
        parts.append(_cap(head + np.array([-0.018, 0, 0.008]), (0.105, 0.088, 0.13), "hair", -0.25))
    return Mesh.merge(parts)


def _cap(centre: np.ndarray, radii: Vector, material: str, brim: float) -> Mesh:
    """Closed dome: the part of an ellipsoid above a share `brim` of its height, lower behind than ahead."""
    whole = ellipsoid(radii, (0, 0, 0), material, 10, 8)
    x, y, z = (whole.vertices / np.asarray(radii)).T
    floor = brim + 0.45 * x
    vertices = np.stack([x, y, np.maximum(z, np.minimum(floor, 0.8))], 1) * np.asarray(radii) + centre
    return Mesh(vertices, whole.faces, whole.materials)


def _skirt(pelvis: np.ndarray, ankles: tuple[Vector, Vector], material: str) -> Mesh:
    reach = abs(float(ankles[0][0]) - float(ankles[1][0])) / 2
    centres = pelvis + np.array([[0, 0, -0.33], [0, 0, -0.17], [0, 0, 0.03], [0, 0, 0.2]])
    depth = (0.17 + 0.52 * reach, 0.15 + 0.26 * reach, 0.145, 0.112)
    return loft(_sections(centres, depth, (0.235, 0.215, 0.200, 0.155), np.array([0, 0, 1.0]), 12), material)


def _backpack(pelvis: np.ndarray, neck: np.ndarray) -> Mesh:
    up = (neck - pelvis) / np.linalg.norm(neck - pelvis)
    behind = np.cross(up, [0.0, 1.0, 0.0])
    centres = pelvis + np.array([0.28, 0.36, 0.72, 0.90, 0.96])[:, None] * (neck - pelvis) + 0.18 * behind
    rings = _sections(centres, (0.06, 0.10, 0.095, 0.07, 0.03), (0.10, 0.145, 0.14, 0.11, 0.05), up, 8)
    return loft(rings, "plastic_dark")
