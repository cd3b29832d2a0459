"""Clouds as drivers and programs write them: each is written here and read back as the same points."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.recordings import RecordingError, open_recording
from tests.cosim.point_files.test_schema_from_scans import scan
from tests.cosim.recordings.test_readers import ply

SWEEP_S, EPOCH_S = 0.1, 1_700_000_000
TAKEN = ("intensity", "ring", "time")
Write = Callable[[Path, "Cloud"], None]


class Cloud:
    """Points of a scan with 16 lasers, firing by firing, and what drivers write about them.

    Attributes:
        xyz: (n, 3) float64, as float32 stores them.
        intensity: (n,) whole numbers of 1 to 255.
        ring: (n,) uint16.
        time_s: (n,) since the start of the sweep.
    """

    def __init__(self, number: int) -> None:
        points = scan(1.0 * number, number).astype(np.float32)
        self.xyz = points[:, :3].astype(np.float64)
        self.intensity = np.round(1 + 250 * points[:, 3]).astype(np.uint8)
        elevation = np.degrees(np.arctan2(self.xyz[:, 2], np.hypot(self.xyz[:, 0], self.xyz[:, 1])))
        self.ring = np.round((elevation + 15) / 2).astype(np.uint16)
        azimuth = np.arctan2(self.xyz[:, 1], self.xyz[:, 0])
        self.time_s = (np.pi - azimuth) / (2 * np.pi) * SWEEP_S

    def __len__(self) -> int:
        return len(self.xyz)


def write_records(path: Path, rows: np.ndarray, height: int = 1, form: str = "binary") -> None:
    """A PCD with the fields of a record array; fields named `_0`, `_1`, … are PCL's padding `_`."""
    names = list(rows.dtype.names or ())
    kinds = [rows.dtype[name].base for name in names]
    counts = [int(np.prod(rows.dtype[name].shape)) for name in names]
    head = {
        "VERSION": [0.7],
        "FIELDS": ["_" if name[0] == "_" else name for name in names],
        "SIZE": [kind.itemsize for kind in kinds],
        "TYPE": [kind.kind.upper() for kind in kinds],
        "COUNT": counts,
        "WIDTH": [len(rows) // height],
        "HEIGHT": [height],
        "VIEWPOINT": [0, 0, 0, 1, 0, 0, 0],
        "POINTS": [len(rows)],
        "DATA": [form],
    }
    text = "".join(f"{key} {' '.join(map(str, values))}\n" for key, values in head.items())
    if form == "ascii":
        body = "".join(" ".join(f"{value:.9g}" for value in row) + "\n" for row in rows.tolist()).encode()
    elif form == "binary_compressed":
        data = b"".join(np.ascontiguousarray(rows[name]).tobytes() for name in names)
        packed = pytest.importorskip("lzf").compress(data, 2 * len(data))
        body = np.array([len(packed), len(data)], "<u4").tobytes() + packed
    else:
        body = rows.tobytes()
    path.write_bytes(text.encode() + body)


def records(cloud: Cloud, kinds: dict[str, str], **more: np.ndarray) -> np.ndarray:
    """A record array with the cloud's columns and further ones under their fields' names."""
    columns = {"x": cloud.xyz[:, 0], "y": cloud.xyz[:, 1], "z": cloud.xyz[:, 2], "intensity": cloud.intensity}
    columns |= {"ring": cloud.ring} | more
    rows = np.zeros(len(cloud), [(name, *_kind(kind)) for name, kind in kinds.items()])
    for name in kinds.keys() & columns.keys():
        rows[name] = columns[name]
    return rows


def _kind(kind: str) -> tuple[Any, ...]:
    base, _, count = kind.partition("*")
    return (base, (int(count),)) if count else (base,)


_XYZ = {"x": "<f4", "y": "<f4", "z": "<f4"}


def pcl_padding(path: Path, cloud: Cloud) -> None:
    write_records(path, records(cloud, {**_XYZ, "_0": "u1*4", "intensity": "<f4", "_1": "u1*12"}))


def velodyne_driver(path: Path, cloud: Cloud) -> None:
    kinds = {**_XYZ, "_0": "u1*4", "intensity": "<f4", "ring": "<u2", "_1": "u1*2", "time": "<f4", "_2": "u1*4"}
    write_records(path, records(cloud, kinds, time=cloud.time_s - SWEEP_S))  # relative to the last packet


def hesai_driver(path: Path, cloud: Cloud) -> None:
    kinds = {**_XYZ, "_0": "u1*4", "intensity": "<f4", "_1": "u1*4", "timestamp": "<f8", "ring": "<u2", "_2": "u1*14"}
    write_records(path, records(cloud, kinds, timestamp=EPOCH_S + cloud.time_s))


def ouster_driver(path: Path, cloud: Cloud) -> None:
    kinds = {**_XYZ, "_0": "u1*4", "intensity": "<f4", "t": "<u4", "reflectivity": "<u2", "ring": "<u2"}
    kinds |= {"ambient": "<u2", "_1": "u1*2", "range": "<u4", "_2": "u1*12"}
    reach = np.linalg.norm(cloud.xyz, axis=1)
    more = {"t": cloud.time_s * 1e9, "range": reach * 1000, "reflectivity": cloud.intensity, "ambient": reach % 7}
    write_records(path, records(cloud, kinds, **more))


def robosense_driver(path: Path, cloud: Cloud) -> None:
    """Organised, 16 rows of 1000, rows without return are NaN."""
    rows = records(cloud, {**_XYZ, "intensity": "u1", "ring": "<u2", "timestamp": "<f8"})
    rows["timestamp"] = EPOCH_S + cloud.time_s
    whole = np.zeros(16_000, rows.dtype)
    for axis in "xyz":
        whole[axis] = np.nan
    whole["timestamp"] = EPOCH_S
    places = np.sort(np.random.default_rng(0).choice(len(whole), len(rows), replace=False))
    whole[places] = rows
    write_records(path, whole, height=16)


def doubles(path: Path, cloud: Cloud) -> None:
    write_records(path, records(cloud, {"x": "<f8", "y": "<f8", "z": "<f8", "intensity": "<f8", "ring": "<i4"}))


def text_pcd(path: Path, cloud: Cloud) -> None:
    write_records(path, records(cloud, {**_XYZ, "intensity": "<f4"}), form="ascii")


def compressed(path: Path, cloud: Cloud) -> None:
    rows = records(cloud, {**_XYZ, "intensity": "<f4", "ring": "<u2", "t": "<u4"}, t=cloud.time_s * 1e9)
    write_records(path, rows, form="binary_compressed")


def cloudcompare_pcd(path: Path, cloud: Cloud) -> None:
    kinds = {**_XYZ, "rgb": "<f4", "scalar_intensity": "<f4", "scalar_ring": "<f4"}
    more = {"scalar_intensity": cloud.intensity, "scalar_ring": cloud.ring}
    write_records(path, records(cloud, kinds, **more))


def cloudcompare_ply(path: Path, cloud: Cloud) -> None:
    kinds = {**_XYZ, "scalar_Intensity": "<f4", "scalar_Ring": "<f4", "scalar_GpsTime": "<f4"}
    more = {"scalar_Intensity": cloud.intensity, "scalar_Ring": cloud.ring, "scalar_GpsTime": cloud.time_s}
    rows = records(cloud, kinds, **more)
    path.write_bytes(ply(rows, "binary_little_endian") + rows.tobytes())


def big_endian_ply(path: Path, cloud: Cloud) -> None:
    rows = records(cloud, {"x": ">f4", "y": ">f4", "z": ">f4", "intensity": ">f4", "ring": ">u2"})
    path.write_bytes(ply(rows, "binary_big_endian") + rows.tobytes())


def raw(kind: str, *columns: str) -> Write:
    def write(path: Path, cloud: Cloud) -> None:
        np.column_stack([cloud.xyz, *(getattr(cloud, name) for name in columns)]).astype(kind).tofile(path)

    return write


def las(path: Path, cloud: Cloud) -> None:
    laspy = pytest.importorskip("laspy")
    if path.suffix == ".laz":
        pytest.importorskip("lazrs")
    header = laspy.LasHeader(point_format=1, version="1.2")
    header.scales = np.full(3, 1e-5)
    written = laspy.LasData(header)
    written.xyz = cloud.xyz
    written.intensity = cloud.intensity.astype(np.uint16) * 256  # as LAS wants it: of 16 bits
    written.gps_time = cloud.time_s
    written.write(path)


def numpy_table(path: Path, cloud: Cloud) -> None:
    np.savez(path, x=cloud.xyz[:, 0], y=cloud.xyz[:, 1], z=cloud.xyz[:, 2], intensity=cloud.intensity, ring=cloud.ring)


VARIANTS: dict[str, tuple[Write, str, str]] = {
    "PCL padding": (pcl_padding, ".pcd", "intensity"),
    "Velodyne ROS driver": (velodyne_driver, ".pcd", "intensity ring time"),
    "Hesai ROS driver": (hesai_driver, ".pcd", "intensity ring time"),
    "Ouster ROS driver": (ouster_driver, ".pcd", "intensity ring time"),
    "RoboSense ROS driver": (robosense_driver, ".pcd", "intensity ring time"),
    "doubles": (doubles, ".pcd", "intensity ring"),
    "text": (text_pcd, ".pcd", "intensity"),
    "compressed": (compressed, ".pcd", "intensity ring time"),
    "CloudCompare PCD": (cloudcompare_pcd, ".pcd", "intensity ring"),
    "CloudCompare PLY": (cloudcompare_ply, ".ply", "intensity ring time"),
    "big-endian PLY": (big_endian_ply, ".ply", "intensity ring"),
    "KITTI": (raw("<f4", "intensity"), ".bin", "intensity"),
    "nuScenes": (raw("<f4", "intensity", "ring"), ".pcd.bin", "intensity ring"),
    "raw doubles": (raw("<f8", "intensity"), ".bin", "intensity"),
    "raw big-endian": (raw(">f4", "intensity"), ".bin", "intensity"),
    "raw with laser and time": (raw("<f4", "intensity", "ring", "time_s"), ".bin", "intensity ring time"),
    "LAS": (las, ".las", "intensity time"),
    "LAZ": (las, ".laz", "intensity time"),
    "NumPy": (numpy_table, ".npz", "intensity ring"),
}


@pytest.mark.parametrize("name", VARIANTS)
def test_clouds_of_drivers_and_programs_are_read_as_written(name: str, tmp_path: Path) -> None:
    write, suffix, columns = VARIANTS[name]
    clouds = [Cloud(number) for number in range(3)]
    for number, cloud in enumerate(clouds):
        write(tmp_path / f"{number:06d}{suffix}", cloud)
    check(open_recording(tmp_path)[1], clouds[1], columns.split(), atol_m=1e-5)


def check(read: Any, cloud: Cloud, columns: list[str], atol_m: float = 0.0) -> None:
    np.testing.assert_allclose(read.xyz, cloud.xyz, atol=atol_m)
    given = {"intensity": read.intensity, "ring": read.ring, "time": read.time_s}
    assert [name for name in TAKEN if given[name] is not None] == columns
    ratio = read.intensity / cloud.intensity
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-5)
    assert 0.5 < read.intensity.max() <= 1
    if "ring" in columns:
        np.testing.assert_array_equal(read.ring, cloud.ring)
    if "time" in columns:
        np.testing.assert_allclose(read.time_s, cloud.time_s - cloud.time_s.min(), atol=2e-6)


@pytest.mark.parametrize(
    ("kind", "unit_s", "start_s"),
    [
        ("<f4", 1, 0),
        ("<f4", 1e-3, 0),
        ("<u4", 1e-6, 3000),
        ("<u4", 1e-9, 0),
        ("<f8", 1, EPOCH_S),
        ("<u8", 1e-9, EPOCH_S),
    ],
    ids=["seconds", "milliseconds", "microseconds of the hour", "nanoseconds", "epoch", "epoch in nanoseconds"],
)
def test_times_of_points_in_any_unit_and_from_any_start_are_read(kind, unit_s, start_s, tmp_path):
    clouds = [Cloud(number) for number in range(3)]
    for number, cloud in enumerate(clouds):
        stamps = np.round((cloud.time_s + SWEEP_S * number) / unit_s) if kind[1] == "u" else cloud.time_s / unit_s
        rows = records(cloud, {**_XYZ, "intensity": "u1", "ring": "<u2", "timestamp": kind})
        rows["timestamp"] = stamps.astype(kind) + np.array(round(start_s / unit_s)).astype(kind)
        write_records(tmp_path / f"{number:06d}.pcd", rows)
    check(open_recording(tmp_path)[1], clouds[1], ["intensity", "ring", "time"])


def test_livox_messages_of_a_bag_are_read(tmp_path: Path) -> None:
    typesys = pytest.importorskip("rosbags.typesys")
    from rosbags.rosbag2 import StoragePlugin, Writer

    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    point, message = "livox_ros_driver2/msg/CustomPoint", "livox_ros_driver2/msg/CustomMsg"
    store.register(
        typesys.get_types_from_msg(
            "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\nuint8 line", point
        )
    )
    store.register(
        typesys.get_types_from_msg(
            "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\nCustomPoint[] "
            "points",
            message,
        )
    )
    clouds = [Cloud(number) for number in range(2)]
    types = store.types
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/livox/lidar", message, typestore=store)
        for number, cloud in enumerate(clouds):
            points = [
                types[point](int(time * 1e9), *map(float, xyz), int(shine), 0, int(line))
                for xyz, shine, line, time in zip(cloud.xyz, cloud.intensity, cloud.ring, cloud.time_s, strict=True)
            ]
            header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](0, 0), "lidar")
            content = types[message](header, 0, len(points), 0, np.zeros(3, np.uint8), points)
            writer.write(connection, 10**18 + number * 10**8, store.serialize_cdr(content, message))
    check(open_recording(tmp_path / "bag")[1], clouds[1], ["intensity", "ring", "time"])


def wrong_pose(path: Path, cloud: Cloud) -> None:
    text_pcd(path, cloud)
    path.write_text(path.read_text().replace("VIEWPOINT 0 0 0", "VIEWPOINT 12 3 0"))


def no_height(path: Path, cloud: Cloud) -> None:
    write_records(path, records(cloud, {"x": "<f4", "y": "<f4", "intensity": "<f4"}))


def georeferenced(path: Path, cloud: Cloud) -> None:
    cloud.xyz += np.array([455_000, 5_423_000, 110])
    doubles(path, cloud)


@pytest.mark.parametrize(
    ("write", "says"),
    [
        (wrong_pose, "VIEWPOINT 12 3 0.*subtract this pose"),
        (no_height, "no field z.*--columns"),
        (georeferenced, "georeferenced"),
    ],
)
def test_clouds_that_cannot_be_read_as_scans_name_the_remedy(write: Write, says: str, tmp_path: Path) -> None:
    for number in range(3):
        write(tmp_path / f"{number:06d}.pcd", Cloud(number))
    with pytest.raises(RecordingError, match=says):
        open_recording(tmp_path)
