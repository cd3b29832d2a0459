"""Lit lamps in camera images: brake lights and indicators of vehicles, and traffic signals. LiDARs ignore them."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from assets.materials import material_index
from assets.mesh import Mesh
from assets.shapes import box
from assets.world.furniture.props import SignalHead
from assets.world.furniture.signs import lens
from sensors.cameras import Images
from sensors.scene import Instances

_RIGHT, _LEFT, _EMERGENCY, _BRAKE = 1, 2, 4, 8  # SUMO user documentation, TraCI/Vehicle Signalling
_BLINKING_HZ = 1.5  # UN Regulation No. 48, 6.5.9.1: 90 ± 30 per minute
_SEPARATOR = "!"  # between a model's name, which cannot contain it, and its lit lamps
_INDICATOR_M = (0.05, 0.16, 0.07)
_LENSES = {"red": 0.3, "amber": 0.0, "green": -0.3}  # heights in the head
_LIT_LENSES: dict[str, tuple[str, ...]] = {
    "r": ("red",),
    "u": ("red", "amber"),
    "y": ("amber",),
    "Y": ("amber",),
    "g": ("green",),
    "G": ("green",),
    "s": ("green",),
}
_BLINKING = "o"
_MAX_DISTANCE_M = 250.0


def with_lamps(instances: Instances, signals: np.ndarray, time_s: float) -> Instances:
    """Replace the models of vehicles by models with lit lamps.

    Args:
        instances: objects at one instant.
        signals: (n,) SUMO's signal bit sets.
        time_s: time of the instant, for the phase of the indicators [s].
    """
    lit_lamps = [_active_lamps(name, int(bits), time_s) for name, bits in zip(instances.ids, signals, strict=True)]
    if not any(lit_lamps):
        return instances
    models = tuple(
        f"{model}{_SEPARATOR}{lamps}" if lamps and kind != "pedestrian" else model
        for model, lamps, kind in zip(instances.models, lit_lamps, instances.kinds, strict=True)
    )
    return replace(instances, models=models)


def base_of(model: str) -> tuple[str, str]:
    """Split a model name into the name without lamps and its lit lamps: any of `b` (brake), `l` and `r`."""
    name, _, lamps = model.partition(_SEPARATOR)
    return name, lamps


def glowing_mesh(mesh: Mesh, lamps: str) -> Mesh:
    """Mesh with lit lamps; unchanged if the model has no lamps."""
    materials = mesh.materials.copy()
    tail, head = material_index("tail_lamp"), material_index("headlamp")
    parts = []
    for side, sign in (("l", 1.0), ("r", -1.0)):
        if side in lamps:
            parts += [_indicator(mesh, row, sign) for row in (tail, head)]
    if "b" in lamps:
        materials[materials == tail] = material_index("lamp_brake")
    return Mesh.merge([Mesh(mesh.vertices, mesh.faces, materials), *parts])


def signal_models() -> dict[str, Mesh]:
    """Meshes of lit lenses by model name, in the axes of a signal head."""
    return {f"signal_{colour}": lens(height, f"lamp_{colour}", lifted_m=0.004) for colour, height in _LENSES.items()}


def with_signals(
    instances: Instances, heads: Sequence[SignalHead], states: Mapping[str, str], position: np.ndarray, time_s: float
) -> Instances:
    """Append the lit lenses of traffic signals to the instances.

    Args:
        instances: objects at one instant.
        heads: signal heads of the site.
        states: SUMO's state letter by lane; heads of other lanes are dark.
        position: (3,) position of the cameras in the world; distant signals are skipped [m].
        time_s: time of the instant, for the phase of flashing amber [s].
    """
    lit_lamps = [
        (head, colour)
        for head in heads
        if head.lane in states and np.linalg.norm(head.pose[:3, 3] - position) < _MAX_DISTANCE_M
        for colour in _active_lenses(states[head.lane], time_s)
    ]
    if not lit_lamps:
        return instances
    count = len(lit_lamps)
    lamps = Instances(
        ids=tuple(f"signal {number}" for number in range(count)),
        kinds=("signal",) * count,
        models=tuple(f"signal_{colour}" for _, colour in lit_lamps),
        poses=np.stack([head.pose for head, _ in lit_lamps]),
        scales=np.ones((count, 3)),
        sizes=np.full((count, 3), 0.3),
        velocity_mps=np.zeros((count, 3)),
        yaw_rate_radps=np.zeros(count),
        paint=np.zeros(count, np.float32),
        rgb=np.zeros((count, 3), np.float32),
    )
    return instances.and_then(lamps)


def without_signals(images: Images, instances: int) -> Images:
    """Set the instance numbers of lit lenses to that of the static world."""
    if images.number is None:
        return images
    return replace(images, number=np.where(images.number > instances, 0, images.number).astype(images.number.dtype))


def _active_lamps(name: str, bits: int, time_s: float) -> str:
    phase = zlib.crc32(name.encode()) / 2**32
    is_on = (time_s * _BLINKING_HZ + phase) % 1.0 < 0.5
    left, right = bits & (_LEFT | _EMERGENCY), bits & (_RIGHT | _EMERGENCY)
    return ("b" if bits & _BRAKE else "") + ("l" if left and is_on else "") + ("r" if right and is_on else "")


def _active_lenses(state: str, time_s: float) -> tuple[str, ...]:
    if state == _BLINKING:
        return ("amber",) if time_s * _BLINKING_HZ % 1.0 < 0.5 else ()
    return _LIT_LENSES.get(state, ())


def _indicator(mesh: Mesh, material: int, sign: float) -> Mesh:
    """Lit indicator at the outer end of the lamps of one side (`sign` of y); empty if the model has no such lamp."""
    corners = mesh.triangles[mesh.materials == material].reshape(-1, 3)
    corners = corners[corners[:, 1] * sign > 0]
    if not len(corners):
        return Mesh.empty()
    low, high = corners.min(0), corners.max(0)
    outwards = np.sign(low[0] + high[0])  # front lamps face forward, rear lamps backward
    size = np.minimum(_INDICATOR_M, np.maximum(high - low, 0.03))
    size[0] = _INDICATOR_M[0]
    x = (high if outwards > 0 else low)[0] - outwards * size[0] * 0.3
    y = sign * (max(abs(low[1]), abs(high[1])) - size[1] * 0.6)
    return box(tuple(size), (float(x), float(y), float((low[2] + high[2]) / 2)), "lamp_amber")
