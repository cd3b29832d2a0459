"""Whatever format a scan was written in, the same points come back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.recordings import RecordingError, Scan, open_recording

STRUCTURE = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "u1"), ("ring", "<u2"), ("t", "<u4")])
SWEEP_NS = 100_000_000


def points(seed: int = 0, count: int = 500) -> np.ndarray:
    """Points of a head of 32 lasers that turns clockwise, with all fields; times span a sweep, from 0."""
    rng = np.random.default_rng(seed)
    rows = np.zeros(count, STRUCTURE)
    rows["intensity"], rows["ring"] = rng.integers(1, 256, count), np.arange(count) % 32
    azimuth = np.pi - 2 * np.pi * np.arange(count) / count
    elevation = np.radians(10 - 1.2 * rows["ring"])
    reach = rng.uniform(5, 40, count)
    rows["x"], rows["y"] = reach * np.cos(elevation) * np.cos(azimuth), reach * np.cos(elevation) * np.sin(azimuth)
    rows["z"] = reach * np.sin(elevation)
    rows["t"] = np.linspace(0, SWEEP_NS - 1, count).astype(np.uint32)
    return rows


def table(rows: np.ndarray, names: tuple[str, ...] = ("x", "y", "z", "intensity")) -> np.ndarray:
    return np.stack([rows[name].astype(np.float32) for name in names], 1)


def same(scan: Scan, rows: np.ndarray, *, ring: bool = True, time: bool = True, full: float = 255.0) -> None:
    np.testing.assert_array_equal(scan.xyz, table(rows)[:, :3].astype(np.float64))
    assert scan.intensity is not None
    np.testing.assert_allclose(scan.intensity, rows["intensity"] / full, rtol=1e-6)
    assert (scan.ring is not None) == ring and (scan.time_s is not None) == time
    if scan.ring is not None:
        np.testing.assert_array_equal(scan.ring, rows["ring"])
    if scan.time_s is not None:
        np.testing.assert_allclose(scan.time_s, rows["t"] * 1e-9, atol=1e-9)


@pytest.mark.parametrize("suffix", [".npy", ".npz", ".pcd", ".ply", ".feather", "text.ply"])
def test_fields_are_detected_by_name(tmp_path: Path, suffix: str) -> None:
    rows = points()
    write(tmp_path / f"000000{suffix}", rows)
    same(open_recording(tmp_path)[0], rows)


def test_a_table_without_names_has_the_usual_order(tmp_path: Path) -> None:
    rows = points()
    table(rows).tofile(tmp_path / "a.bin")
    same(open_recording(tmp_path)[0], rows, ring=False, time=False)
    (tmp_path / "a.bin").unlink()
    table(rows, ("x", "y", "z", "intensity", "ring")).tofile(tmp_path / "a.pcd.bin")
    same(open_recording(tmp_path)[0], rows, time=False)


@pytest.mark.parametrize("width", [3, 4, 5])
def test_the_width_of_raw_rows_is_detected(tmp_path: Path, width: int) -> None:
    rows = points(count=600)  # so that bytes divide by each width
    table(rows, ("x", "y", "z", "intensity", "ring")[:width]).tofile(tmp_path / "a.bin")
    scan = open_recording(tmp_path)[0]
    np.testing.assert_array_equal(scan.xyz, table(rows)[:, :3].astype(np.float64))
    assert (scan.intensity is None) == (width == 3) and (scan.ring is None) == (width < 5)


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_bags_give_the_clouds_of_their_topic(tmp_path: Path, kind: str) -> None:
    clouds = [points(seed) for seed in range(3)]
    bag = write_bag(tmp_path, kind, {"/lidar": clouds})
    recording = open_recording(bag)
    assert len(recording) == 3 and recording.interval_s == pytest.approx(0.1)
    for number in (2, 0, 1):  # in any order
        same(recording[number], clouds[number])


def test_several_topics_ask_for_one(tmp_path: Path) -> None:
    bag = write_bag(tmp_path, "mcap", {"/left": [points()], "/right": [points(1)]})
    with pytest.raises(RecordingError, match="choose with --topic: /left, /right"):
        open_recording(bag)
    same(open_recording(bag, topic="/right")[0], points(1))


def test_a_bag_of_packets_says_what_it_holds(tmp_path: Path) -> None:
    bag = write_bag(tmp_path, "sqlite3", {})
    with pytest.raises(RecordingError, match=r"no PointCloud2 in this bag; it holds /said \(std_msgs/msg/String\)"):
        open_recording(bag)


def test_rows_that_are_no_returns_are_left_out_and_counted(tmp_path: Path) -> None:
    rows = points()
    rows["x"][3] = np.nan
    for axis in "xyz":
        rows[axis][7] = 0
    write(tmp_path / "a.npy", rows)
    scan = open_recording(tmp_path)[0]
    assert scan.dropped == 2
    same(scan, np.delete(rows, [3, 7]))


def test_the_scale_of_intensities_follows_the_field_and_the_user(tmp_path: Path) -> None:
    rows = points()
    types = {name: "<u2" if name == "intensity" else STRUCTURE[name].str for name in STRUCTURE.names or ()}
    wide = rows.astype(list(types.items()))
    wide["intensity"] = wide["intensity"] * 200
    write(tmp_path / "a.npy", wide)
    recording = open_recording(tmp_path)
    same(recording[0], wide, full=65535.0)
    assert any("--intensity-scale" in note for note in recording.notes)
    half = open_recording(tmp_path, intensity_scale=2 * 65535.0)[0].intensity
    assert half is not None
    np.testing.assert_allclose(half, wide["intensity"] / 131070, rtol=1e-6)


@pytest.mark.parametrize(("name", "unit"), [("time", 1.0), ("timestamp", 1e-3), ("offset_time", 1e-9)])
def test_the_unit_of_times_is_that_in_which_a_scan_lasts_a_sweep(tmp_path: Path, name: str, unit: float) -> None:
    rows = points()
    columns: dict[str, Any] = {axis: rows[axis] for axis in "xyz"} | {name: 77 + rows["t"] * 1e-9 / unit}
    np.savez(tmp_path / "a.npz", **columns)
    time_s = open_recording(tmp_path)[0].time_s
    assert time_s is not None
    np.testing.assert_allclose(time_s, rows["t"] * 1e-9, atol=1e-6)


def test_a_file_cut_off_is_named(tmp_path: Path) -> None:
    for suffix in (".pcd", ".npy", ".feather", ".bin", ".ply"):
        file = tmp_path / f"a{suffix}"
        write(file, points())
        file.write_bytes(file.read_bytes()[:-101])
        with pytest.raises(RecordingError, match="cut off") as caught:
            open_recording(file)[0]
        assert str(file) in str(caught.value) and "\n" not in str(caught.value)
        file.unlink()


def test_a_bag_cut_off_is_named(tmp_path: Path) -> None:
    bag = write_bag(tmp_path, "ros1", {"/lidar": [points()] * 3})
    bag.write_bytes(bag.read_bytes()[:-200])
    with pytest.raises(RecordingError, match="cut off"):
        open_recording(bag)


def write(file: Path, rows: np.ndarray) -> None:
    """A file of the format that its suffix says, by its usual writer."""
    names = list(rows.dtype.names or ())
    if file.name.endswith("text.ply"):
        file.write_bytes(
            ply(rows, "ascii") + "".join(f"{' '.join(map(repr, row.tolist()))}\n" for row in rows).encode()
        )
    elif file.suffix == ".ply":
        file.write_bytes(ply(rows, "binary_little_endian") + rows.tobytes())
    elif file.suffix == ".npy":
        np.save(file, rows)
    elif file.suffix == ".npz":
        columns: dict[str, Any] = {name: rows[name] for name in names}
        np.savez(file, **columns)
    elif file.suffix == ".pcd":
        types = [rows.dtype[name].type for name in names]
        pytest.importorskip("pypcd4").PointCloud.from_points([rows[n] for n in names], names, types).save(file)
    elif file.suffix == ".feather":
        polars = pytest.importorskip("polars")
        polars.DataFrame({name: rows[name] for name in names}).write_ipc(file, compression="lz4")
    else:
        table(rows).tofile(file)


def ply(rows: np.ndarray, form: str) -> bytes:
    types = {"f4": "float", "u1": "uchar", "u2": "ushort", "u4": "uint"}
    stored = rows.dtype
    properties = "".join(f"property {types[stored[name].str[1:]]} {name}\n" for name in stored.names or ())
    return f"ply\nformat {form} 1.0\nelement vertex {len(rows)}\n{properties}end_header\n".encode()


def write_bag(folder: Path, kind: str, topics: dict[str, list[np.ndarray]]) -> Path:
    """A bag with clouds every 0.1 s; with only a text message if there are none."""
    typesys = pytest.importorskip("rosbags.typesys")
    old = kind == "ros1"
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC if old else typesys.Stores.ROS2_HUMBLE)
    if old:
        from rosbags.rosbag1 import Writer

        path, writer = folder / "bag.bag", Writer(folder / "bag.bag")
    else:
        from rosbags.rosbag2 import StoragePlugin, Writer

        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        path = folder / "bag"
        writer = Writer(path, version=9, storage_plugin=plugin)
    encode = store.serialize_ros1 if old else store.serialize_cdr
    with writer:
        for topic, clouds in topics.items():
            name = "sensor_msgs/msg/PointCloud2"
            connection = writer.add_connection(topic, name, typestore=store)
            for number, rows in enumerate(clouds):
                writer.write(connection, 10**18 + number * 10**8, encode(cloud(store, rows, old), name))
        if not topics:
            name = "std_msgs/msg/String"
            connection = writer.add_connection("/said", name, typestore=store)
            writer.write(connection, 1, encode(store.types[name](data="word"), name))
    return path


def cloud(store: object, rows: np.ndarray, old: bool) -> object:
    types = store.types  # type: ignore[attr-defined]
    stamp = types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="lidar", **({"seq": 0} if old else {}))
    codes = {"f4": 7, "u1": 2, "u2": 4, "u4": 6}
    fields = [
        types["sensor_msgs/msg/PointField"](name=name, offset=position[1], datatype=codes[position[0].str[1:]], count=1)
        for name, position in (rows.dtype.fields or {}).items()
    ]
    size = rows.dtype.itemsize
    return types["sensor_msgs/msg/PointCloud2"](
        header=header,
        height=1,
        width=len(rows),
        fields=fields,
        is_bigendian=False,
        point_step=size,
        row_step=size * len(rows),
        data=np.frombuffer(rows.tobytes(), np.uint8),
        is_dense=True,
    )
