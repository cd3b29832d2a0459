"""Lamps that are lit: brake lights and indicators of vehicles, and the signals of junctions. Cameras alone see them."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from assets.materials import material_index
from assets.mesh import Mesh
from assets.shapes import box
from assets.world import SignalHead
from assets.world.signs import lens
from sensors.cameras import Images
from sensors.scene import Instances

_RIGHT, _LEFT, _EMERGENCY, _BRAKE = 1, 2, 4, 8  # SUMO user documentation, TraCI/Vehicle Signalling
_BLINKS_HZ = 1.5  # UN Regulation No. 48, 6.5.9.1: 90 ± 30 a minute
_MARK = "!"  # between a model's name, which cannot hold it, and its lit lamps
_INDICATOR_M = (0.05, 0.16, 0.07)
_LENSES = {"red": 0.3, "amber": 0.0, "green": -0.3}  # heights in the head
_SHOWS: dict[str, tuple[str, ...]] = {
    "r": ("red",),
    "u": ("red", "amber"),
    "y": ("amber",),
    "Y": ("amber",),
    "g": ("green",),
    "G": ("green",),
    "s": ("green",),
}
_BLINKING = "o"
_SEEN_M = 250.0


def with_lamps(instances: Instances, signals: np.ndarray, time_s: float) -> Instances:
    """The same vehicles with models whose lamps are lit as they signal.

    Args:
        instances: of one instant.
        signals: (n,) SUMO's bit sets.
        time_s: of it; indicators blink.
    """
    lit = [_lit(name, int(bits), time_s) for name, bits in zip(instances.ids, signals, strict=True)]
    if not any(lit):
        return instances
    models = tuple(
        f"{model}{_MARK}{lamps}" if lamps and kind != "pedestrian" else model
        for model, lamps, kind in zip(instances.models, lit, instances.kinds, strict=True)
    )
    return replace(instances, models=models)


def base_of(model: str) -> tuple[str, str]:
    """A model's name without its lit lamps, and those: any of `b` (brake), `l` and `r`."""
    name, _, lamps = model.partition(_MARK)
    return name, lamps


def lit_mesh(mesh: Mesh, lamps: str) -> Mesh:
    """A model with lit lamps; one that has none stays dark."""
    materials = mesh.materials.copy()
    tail, head = material_index("tail_lamp"), material_index("headlamp")
    parts = []
    for side, way in (("l", 1.0), ("r", -1.0)):
        if side in lamps:
            parts += [_indicator(mesh, row, way) for row in (tail, head)]
    if "b" in lamps:
        materials[materials == tail] = material_index("lamp_brake")
    return Mesh.merge([Mesh(mesh.vertices, mesh.faces, materials), *parts])


def signal_models() -> dict[str, Mesh]:
    """Lit lenses by model name, in the axes of a signal head."""
    return {f"signal_{colour}": lens(height, f"lamp_{colour}", lifted_m=0.004) for colour, height in _LENSES.items()}


def with_signals(
    instances: Instances, heads: Sequence[SignalHead], states: Mapping[str, str], place: np.ndarray, time_s: float
) -> Instances:
    """Instances and after them the lit lenses of signals.

    Args:
        instances: of one instant.
        heads: of the place.
        states: SUMO's letter by lane; heads of other lanes are dark.
        place: (3,) where the cameras are; far signals are left out.
        time_s: of the instant; flashing amber blinks.
    """
    lit = [
        (head, colour)
        for head in heads
        if head.lane in states and np.linalg.norm(head.pose[:3, 3] - place) < _SEEN_M
        for colour in _shown(states[head.lane], time_s)
    ]
    if not lit:
        return instances
    count = len(lit)
    lamps = Instances(
        ids=tuple(f"signal {number}" for number in range(count)),
        kinds=("signal",) * count,
        models=tuple(f"signal_{colour}" for _, colour in lit),
        poses=np.stack([head.pose for head, _ in lit]),
        scales=np.ones((count, 3)),
        sizes=np.full((count, 3), 0.3),
        velocity_mps=np.zeros((count, 3)),
        yaw_rate_radps=np.zeros(count),
        paint=np.zeros(count, np.float32),
        rgb=np.zeros((count, 3), np.float32),
    )
    return instances.and_then(lamps)


def without_signals(images: Images, instances: int) -> Images:
    """Images in whose instance numbers lit lenses are part of the static world again."""
    if images.number is None:
        return images
    return replace(images, number=np.where(images.number > instances, 0, images.number).astype(images.number.dtype))


def _lit(name: str, bits: int, time_s: float) -> str:
    phase = zlib.crc32(name.encode()) / 2**32
    on = (time_s * _BLINKS_HZ + phase) % 1.0 < 0.5
    left, right = bits & (_LEFT | _EMERGENCY), bits & (_RIGHT | _EMERGENCY)
    return ("b" if bits & _BRAKE else "") + ("l" if left and on else "") + ("r" if right and on else "")


def _shown(state: str, time_s: float) -> tuple[str, ...]:
    if state == _BLINKING:
        return ("amber",) if time_s * _BLINKS_HZ % 1.0 < 0.5 else ()
    return _SHOWS.get(state, ())


def _indicator(mesh: Mesh, material: int, way: float) -> Mesh:
    """A lit indicator at the outer end of a model's lamps of one side; none where it has no such lamp."""
    corners = mesh.triangles[mesh.materials == material].reshape(-1, 3)
    corners = corners[corners[:, 1] * way > 0]
    if not len(corners):
        return Mesh.empty()
    low, high = corners.min(0), corners.max(0)
    outwards = np.sign(low[0] + high[0])  # front lamps look ahead, rear lamps back
    size = np.minimum(_INDICATOR_M, np.maximum(high - low, 0.03))
    size[0] = _INDICATOR_M[0]
    x = (high if outwards > 0 else low)[0] - outwards * size[0] * 0.3
    y = way * (max(abs(low[1]), abs(high[1])) - size[1] * 0.6)
    return box(tuple(size), (float(x), float(y), float((low[2] + high[2]) / 2)), "lamp_amber")
