"""ROS 1 and ROS 2 bags, SQLite and MCAP: the messages of one topic of clouds.

sensor_msgs/PointCloud2 and PointField as ROS defines them (docs.ros.org); livox_ros_driver's CustomMsg.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cosim.point_files import Columns
from cosim.recordings.libraries import needed
from cosim.recordings.reading.foxglove import foxglove_sources
from cosim.recordings.reading.source import Source
from cosim.recordings.scan import RecordingError

CLOUD = "sensor_msgs/msg/PointCloud2"
_SUFFIXES = (".bag", ".db3", ".mcap")
_KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}  # sensor_msgs/PointField


def is_bag(path: Path) -> bool:
    """Whether a path is a bag: its file, or the folder of one."""
    if path.is_file():
        return path.suffix.lower() in _SUFFIXES
    return path.is_dir() and bool(_stores(path))


def bag_sources(path: Path, topic: str | None = None) -> tuple[Source, ...]:
    """Scans of a bag's topic, in the order of their stamps; each is read from the bag on demand.

    Args:
        path: file or folder.
        topic: which; may be left out where only one holds clouds.

    Raises:
        RecordingError: no topic, several, or the bag cannot be read.
    """
    if path.is_dir() and not (path / "metadata.yaml").is_file() and len(_stores(path)) == 1:
        path = _stores(path)[0]
    clouds = foxglove_sources(path, topic)
    if clouds is not None:
        return clouds
    try:
        with _reader(path) as reader:
            name = _chosen(reader, path, topic)
            chosen = [connection for connection in reader.connections if connection.topic == name]
            stamps_ns = [stamp for _, stamp, _ in reader.messages(connections=chosen)]
    except RecordingError:
        raise
    except Exception as error:  # noqa: BLE001 - rosbags raises whatever it meets in a damaged bag
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:160]
        raise RecordingError(
            f"{path}: not a readable bag ({reason}); it is cut off or damaged: record or copy it again"
        ) from None
    cursor = _Cursor(path, name)
    return tuple(
        Source(f"{number:06d}", partial(cursor.columns, number), stamp / 1e9) for number, stamp in enumerate(stamps_ns)
    )


class _Cursor:
    """Reads messages by number; going forward keeps the place, so that a pass over the bag reads it once."""

    def __init__(self, path: Path, topic: str) -> None:
        self._path, self._topic = path, topic
        self._reader: Any = None
        self._messages: Any = None
        self._next = 0

    def __getstate__(self) -> dict[str, Any]:
        return {"_path": self._path, "_topic": self._topic, "_reader": None, "_messages": None, "_next": 0}

    def columns(self, number: int) -> Columns:
        """The columns of one message.

        Raises:
            RecordingError: the bag ends before it, or is damaged there.
        """
        try:
            if self._messages is None or number < self._next:
                self._rewind()
            for connection, _, data in self._messages or ():
                self._next += 1
                if self._next > number:
                    return _DECODERS[connection.msgtype](self._reader.deserialize(data, connection.msgtype))
        except RecordingError:
            raise
        except Exception as error:  # noqa: BLE001 - see above
            reason = " ".join(f"{type(error).__name__}: {error}".split())[:160]
            raise RecordingError(f"{self._path}: message {number} of {self._topic} cannot be read ({reason})") from None
        raise RecordingError(f"{self._path}: ends before message {number} of {self._topic}")

    def _rewind(self) -> None:
        if self._reader is not None:
            self._reader.close()
        self._reader = _reader(self._path)
        self._reader.open()
        chosen = [connection for connection in self._reader.connections if connection.topic == self._topic]
        self._messages, self._next = self._reader.messages(connections=chosen), 0


def cloud_columns(message: Any) -> Columns:
    """The fields of a PointCloud2, (n,) each.

    Raises:
        RecordingError: the data are shorter than width × height × point_step.
    """
    order = ">" if message.is_bigendian else "<"
    single = [field for field in message.fields if field.count == 1 and field.datatype in _KINDS]
    row = np.dtype(
        {
            "names": [field.name for field in single],
            "formats": [order + _KINDS[field.datatype] for field in single],
            "offsets": [field.offset for field in single],
            "itemsize": message.point_step,
        }
    )
    count, data = message.width * message.height, bytes(message.data)
    lines = message.height if message.row_step > message.width * message.point_step else 1
    if len(data) < (message.row_step * lines if lines > 1 else count * message.point_step):
        raise RecordingError(f"a cloud of {count} points holds {len(data)} bytes, too few; record it again")
    if lines > 1:  # rows may end in padding
        parts = [np.frombuffer(data, row, message.width, line * message.row_step) for line in range(lines)]
        points = np.concatenate(parts)
    else:
        points = np.frombuffer(data, row, count)
    return {name: points[name].astype(points[name].dtype.newbyteorder("=")) for name in row.names or ()}


def livox_columns(message: Any) -> Columns:
    """The fields of a CustomMsg of livox_ros_driver, (n,) each."""
    names = ("x", "y", "z", "reflectivity", "offset_time", "line")
    rows = np.array([[getattr(point, name) for name in names] for point in message.points], np.float64)
    rows = rows.reshape(-1, len(names))
    kinds = ("f4", "f4", "f4", "u1", "u4", "u1")
    return {name: rows[:, at].astype(kind) for at, (name, kind) in enumerate(zip(names, kinds, strict=True))}


_DECODERS: dict[str, Callable[[Any], Columns]] = {
    CLOUD: cloud_columns,
    "livox_ros_driver/msg/CustomMsg": livox_columns,
    "livox_ros_driver2/msg/CustomMsg": livox_columns,
}


def _reader(path: Path) -> Any:
    highlevel, typesys = needed("rosbags.highlevel", "a ROS bag"), needed("rosbags.typesys", "a ROS bag")
    stores = [path] if path.is_file() or (path / "metadata.yaml").is_file() else _stores(path)
    return highlevel.AnyReader(stores, default_typestore=typesys.get_typestore(typesys.Stores.ROS2_HUMBLE))


def _stores(folder: Path) -> list[Path]:
    return sorted(item for item in folder.iterdir() if item.suffix.lower() in _SUFFIXES)


def _chosen(reader: Any, path: Path, topic: str | None) -> str:
    types = {connection.topic: connection.msgtype for connection in reader.connections}
    clouds = sorted(name for name, kind in types.items() if kind in _DECODERS)
    if topic is not None:
        if topic not in clouds:
            raise RecordingError(f"{path}: no PointCloud2 on {topic}; choose from {', '.join(clouds) or 'none'}")
        return topic
    if not clouds:
        held = ", ".join(f"{name} ({kind})" for name, kind in sorted(types.items())) or "nothing"
        raise RecordingError(
            f"{path}: no PointCloud2 in this bag; it holds {held}: play packets through the sensor's driver and record "
            "its clouds"
        )
    if len(clouds) > 1:
        raise RecordingError(f"{path}: clouds on {len(clouds)} topics; choose with --topic: {', '.join(clouds)}")
    return clouds[0]
