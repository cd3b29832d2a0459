"""One frame of a twin: where everything was at the pose time, and how it moved (`twin/frames/NAME.json`).

Poses are world poses (x east, y north, z up), 4 × 4, right-handed. Within a sweep p(t) = p0 + v·t and
R(t) = Rz(ω·t)·R0, t from the pose time. Files hold lengths to 1 µm and rotations to 1e-9; who wants to
trace exactly what a reader will trace, traces `TwinFrame.from_json(frame.to_json())`.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from assets.documents import parse_json
from cosim.drives.files import read_text
from cosim.drives.twin.json_values import Reader, arrays, matrix_json, number_json, poses, positives, vector_json
from cosim.errors import FormatError
from sensors.cameras.lens import Distortion
from sensors.pattern import first_problem


@dataclass(frozen=True, eq=False)
class Ego:
    """The vehicle that carries the sensors.

    Attributes:
        pose: (4, 4) world pose of its ground-level centre.
        velocity_mps: (3,) in world axes.
        yaw_rate_radps: about world z.
        acceleration_mps2: (3,) in world axes.
    """

    pose: np.ndarray
    velocity_mps: np.ndarray
    yaw_rate_radps: float
    acceleration_mps2: np.ndarray


@dataclass(frozen=True, eq=False)
class Lidar:
    """A LiDAR.

    Attributes:
        pose_ego: (4, 4) carries its axes into the ego's.
        pattern: name of the beam pattern.
        sweep_s: duration of a turn of its head, where it differs from the frame's; else None.
        name: in a rig of its own; else empty.
    """

    pose_ego: np.ndarray
    pattern: str
    sweep_s: float | None = None
    name: str = ""


@dataclass(frozen=True, eq=False)
class TwinCamera:
    """A camera, x right, y down, z forward.

    Attributes:
        pose_ego: (4, 4) carries its axes into the ego's.
        P: (3, 4) projection of rectified camera axes to pixels.
        width, height: image size [px].
        distortion: of its lens, in pixels after P's own matrix; None for a pinhole.
    """

    pose_ego: np.ndarray
    P: np.ndarray
    width: int
    height: int
    distortion: Distortion | None = None


@dataclass(frozen=True, eq=False)
class Instance:
    """One thing that can move, parked ones too; not the ego vehicle.

    Attributes:
        id: SUMO's id.
        kind: car, van, truck, pedestrian, …
        model: NAME of `twin/models/NAME.glb`.
        pose: (4, 4) world pose of the ground-level centre of its box.
        velocity_mps: (3,) in world axes.
        yaw_rate_radps: about world z.
        length_m, width_m, height_m: its box.
        scale: (3,) applied to the model before the pose.
        paint: reflectance of its paint materials at 905 nm, 0–1.
    """

    id: str
    kind: str
    model: str
    pose: np.ndarray
    velocity_mps: np.ndarray
    yaw_rate_radps: float
    length_m: float
    width_m: float
    height_m: float
    scale: np.ndarray
    paint: float


class InstanceTexts:
    """JSON of instances, cached while they do not move: most of a town's vehicles are parked."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[bytes, str]] = {}

    def of(self, instances: Sequence[Instance]) -> list[str]:
        """The text of each instance.

        Raises:
            ValueError: a value is NaN or infinite.
        """
        before, self._known = self._known, {}
        keys = [_state(instance) for instance in instances]
        texts: list[str | None] = []
        for instance, key in zip(instances, keys, strict=True):
            known = before.get(instance.id)
            texts.append(known[1] if known is not None and known[0] == key else None)
        stirring = [row for row, text in enumerate(texts) if text is None]
        for row, entry in zip(stirring, _instances_json([instances[row] for row in stirring]), strict=True):
            texts[row] = _dumps(entry)
        found = [text for text in texts if text is not None]
        for instance, key, text in zip(instances, keys, found, strict=True):
            self._known[instance.id] = key, text
        return found


@dataclass(frozen=True, eq=False)
class TwinFrame:
    """State of the ego vehicle and of all objects at the pose time of one frame.

    Attributes:
        frame: its name, as in `velodyne/NAME.bin`.
        time_s: pose time in the simulation.
        sweep_s: duration of a turn of the head.
        ego, lidar: see there.
        cameras: by image folder, as `image_0`.
        instances: see there.
        static: the static world of this frame relative to `twin/`, where a drive has several; else None.
        lidars: additional LiDARs, by name.
    """

    frame: str
    time_s: float
    sweep_s: float
    ego: Ego
    lidar: Lidar
    cameras: Mapping[str, TwinCamera]
    instances: tuple[Instance, ...]
    static: str | None = None
    lidars: Mapping[str, Lidar] = field(default_factory=dict)

    def seen_by(self, lidar: str) -> TwinFrame:
        """The frame with another of its LiDARs instead of the first one.

        Raises:
            FormatError: it has none of that name.
        """
        if lidar not in self.lidars:
            known = ", ".join(self.lidars) or "no additional ones"
            raise FormatError(f"twin frame {self.frame}: no LiDAR {lidar!r} under lidars; there: {known}")
        chosen = self.lidars[lidar]
        return replace(self, lidar=chosen, lidars={}, sweep_s=chosen.sweep_s or self.sweep_s)

    def to_json(self, instances: InstanceTexts | None = None) -> str:
        """The text of the file; equal frames give equal text.

        Args:
            instances: texts of earlier frames, of which those are taken that still hold, and added to.

        Raises:
            FormatError: a value is NaN or infinite.
        """
        document: dict[str, Any] = {
            "frame": self.frame,
            "time_s": number_json(self.time_s),
            "sweep_s": number_json(self.sweep_s),
        }
        if self.static is not None:
            document["static"] = self.static
        document["ego"] = {
            "pose": matrix_json(self.ego.pose),
            "velocity_mps": vector_json(self.ego.velocity_mps),
            "yaw_rate_radps": number_json(self.ego.yaw_rate_radps),
            "acceleration_mps2": vector_json(self.ego.acceleration_mps2),
        }
        document["lidar"] = _lidar_json(self.lidar)
        if self.lidars:
            document["lidars"] = {name: _lidar_json(lidar) for name, lidar in self.lidars.items()}
        document["cameras"] = {name: _camera_json(camera) for name, camera in self.cameras.items()}
        try:
            head = _dumps(document)
            entries = (instances or InstanceTexts()).of(self.instances)
            return f'{head[:-1]},"instances":[{",".join(entries)}]}}\n'
        except ValueError:
            raise FormatError(f"twin frame {self.frame}: a value is NaN or infinite; poses must be finite") from None

    @classmethod
    def from_json(cls, text: str, source: str | Path = "twin frame") -> TwinFrame:
        """The frame in the text of a file; unknown keys are passed over.

        Raises:
            FormatError: not JSON, a key missing, or a value of the wrong kind, shape or range.
        """
        try:
            document = parse_json(text)
        except ValueError as error:
            raise FormatError(f"{source}: not readable as JSON ({error}); write it again") from None
        root = Reader(document, str(source))
        ego, lidar, cameras = root.child("ego"), root.child("lidar"), root.child("cameras")
        return cls(
            frame=root.text("frame"),
            time_s=root.number("time_s"),
            sweep_s=root.number("sweep_s", above=0),
            ego=Ego(
                pose=ego.pose("pose"),
                velocity_mps=ego.array("velocity_mps", (3,)),
                yaw_rate_radps=ego.number("yaw_rate_radps"),
                acceleration_mps2=ego.array("acceleration_mps2", (3,)),
            ),
            lidar=_lidar(lidar),
            cameras={name: _camera(cameras.child(name)) for name in cameras.keys},
            instances=_instances(root.children("instances")),
            static=root.path("static") if "static" in root.keys else None,
            lidars=_lidars(root.child("lidars")) if "lidars" in root.keys else {},
        )


def read_frame(path: str | Path) -> TwinFrame:
    """Read a frame; see `TwinFrame.from_json`."""
    return TwinFrame.from_json(read_text(path), path)


def write_frame(path: str | Path, frame: TwinFrame) -> None:
    """Write a frame; see `TwinFrame.to_json`."""
    Path(path).write_text(frame.to_json(), encoding="utf-8", newline="\n")


def _lidar_json(lidar: Lidar) -> dict[str, Any]:
    entry: dict[str, Any] = {"name": lidar.name} if lidar.name else {}
    entry |= {"pose_ego": matrix_json(lidar.pose_ego), "pattern": lidar.pattern}
    return entry if lidar.sweep_s is None else {**entry, "sweep_s": number_json(lidar.sweep_s)}


def _camera_json(camera: TwinCamera) -> dict[str, Any]:
    entry = {
        "pose_ego": matrix_json(camera.pose_ego),
        "P": matrix_json(camera.P),
        "width": int(camera.width),
        "height": int(camera.height),
    }
    return entry if camera.distortion is None else {**entry, "distortion": camera.distortion.model_dump(mode="json")}


def _state(instance: Instance) -> bytes:
    """Variable properties of an instance with a given id, and its appearance."""
    one = instance
    numbers = struct.pack("5d", one.yaw_rate_radps, one.length_m, one.width_m, one.height_m, one.paint)
    looks = f"{one.kind} {one.model}".encode()
    return b"".join([one.pose.tobytes(), one.velocity_mps.tobytes(), one.scale.tobytes(), numbers, looks])


_dumps = json.JSONEncoder(separators=(",", ":"), allow_nan=False, ensure_ascii=False).encode


def _instances_json(instances: Sequence[Instance]) -> list[dict[str, Any]]:
    """All at once: one by one, hundreds of parked cars take longer than a scan."""
    if not instances:
        return []
    pose = matrix_json(np.stack([instance.pose for instance in instances]))
    velocity, scale = (
        vector_json(np.stack([getattr(instance, name) for instance in instances])) for name in ("velocity_mps", "scale")
    )
    yaw_rate, length, width, height, paint = (
        vector_json(np.array([getattr(instance, name) for instance in instances], np.float64))
        for name in ("yaw_rate_radps", "length_m", "width_m", "height_m", "paint")
    )
    return [
        {
            "id": instance.id,
            "kind": instance.kind,
            "model": instance.model,
            "pose": pose[row],
            "velocity_mps": velocity[row],
            "yaw_rate_radps": yaw_rate[row],
            "length_m": length[row],
            "width_m": width[row],
            "height_m": height[row],
            "scale": scale[row],
            "paint": paint[row],
        }
        for row, instance in enumerate(instances)
    ]


def _lidar(entry: Reader) -> Lidar:
    return Lidar(
        pose_ego=entry.pose("pose_ego"),
        pattern=entry.text("pattern"),
        sweep_s=entry.number("sweep_s", above=0) if "sweep_s" in entry.keys else None,
        name=entry.name("name") if "name" in entry.keys else "",
    )


def _lidars(entries: Reader) -> dict[str, Lidar]:
    return {name: _lidar(entries.child(name)) for name in entries.keys}


def _camera(entry: Reader) -> TwinCamera:
    width, height = entry.number("width", above=0), entry.number("height", above=0)
    distortion = None
    if "distortion" in entry.keys:
        try:
            distortion = Distortion.model_validate(entry.value("distortion"))
        except ValidationError as error:
            raise FormatError(f"{entry.where}: distortion: {first_problem(error)}") from None
    return TwinCamera(entry.pose("pose_ego"), entry.array("P", (3, 4)), int(width), int(height), distortion)


def _instances(entries: list[Reader]) -> tuple[Instance, ...]:
    pose, velocity, scale = (
        poses(entries, "pose"),
        arrays(entries, "velocity_mps", (3,)),
        arrays(entries, "scale", (3,)),
    )
    yaw_rate, paint = arrays(entries, "yaw_rate_radps", ()).tolist(), arrays(entries, "paint", ()).tolist()
    length, width, height = (positives(entries, key) for key in ("length_m", "width_m", "height_m"))
    return tuple(
        Instance(
            id=entry.text("id"),
            kind=entry.text("kind"),
            model=entry.name("model"),
            pose=pose[row],
            velocity_mps=velocity[row],
            yaw_rate_radps=yaw_rate[row],
            length_m=length[row],
            width_m=width[row],
            height_m=height[row],
            scale=scale[row],
            paint=paint[row],
        )
        for row, entry in enumerate(entries)
    )
