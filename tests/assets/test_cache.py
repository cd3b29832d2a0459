"""Cached values equal newly computed ones."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from assets.cache import FOLDER, _folder, cached, cached_latest
from assets.mesh import Mesh
from assets.models import build_model

MADE: list[float] = []


def stretched(mesh: Mesh, by: float = 1.0) -> Mesh:
    MADE.append(by)
    return Mesh(mesh.vertices * np.float32(by), mesh.faces, mesh.materials)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(FOLDER, str(tmp_path / "kept"))
    MADE.clear()
    return tmp_path / "kept"


def test_the_same_arguments_are_requested_once(folder):
    mesh, keep = build_model("saloon_01"), cached(stretched)
    first = keep(mesh, by=2.0)
    for again in (
        keep(Mesh(mesh.vertices.copy(), mesh.faces, mesh.materials), by=2.0),
        cached(stretched)(mesh, by=2.0),
    ):
        assert np.array_equal(again.vertices, first.vertices) and np.array_equal(again.faces, first.faces)
    assert MADE == [2.0]
    assert keep(mesh, by=3.0).bounds == pytest.approx(1.5 * first.bounds)
    assert MADE == [2.0, 3.0]


def test_a_damaged_result_is_made_anew(folder):
    mesh = build_model("saloon_01")
    first = cached(stretched)(mesh, 2.0)
    for path in folder.rglob("*.bin"):
        path.write_bytes(path.read_bytes()[:100])
    assert np.array_equal(cached(stretched)(mesh, 2.0).vertices, first.vertices)
    assert MADE == [2.0, 2.0]


def test_nothing_is_cached_without_request(tmp_path, monkeypatch):
    monkeypatch.setenv(FOLDER, "")
    monkeypatch.chdir(tmp_path)
    MADE.clear()
    keep = cached(stretched)
    keep(build_model("saloon_01"), 2.0)
    keep(build_model("saloon_01"), 2.0)
    assert MADE == [2.0, 2.0] and not list(tmp_path.iterdir())


def test_without_a_folder_to_write_everything_is_made(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv(FOLDER, str(tmp_path / "file" / "kept"))
    MADE.clear()
    assert len(cached(stretched)(build_model("saloon_01"), 2.0).faces) and MADE == [2.0]


def test_what_other_versions_left_is_removed_when_it_is_old(folder):
    old, young = folder / "tests-0123", folder / "tests-4567"
    for left in (old, young):
        left.mkdir(parents=True)
        (left / "result").write_bytes(b"1")
    os.utime(old, (0, 0))
    cached(stretched)(build_model("saloon_01"), 2.0)
    assert not old.exists() and young.exists()


def test_what_killed_processes_left_is_removed_after_a_day(folder):
    mesh = build_model("saloon_01")
    cached(stretched)(mesh, 2.0)
    (own,) = folder.glob("tests-*")
    old, young = own / "stretched-1.bin.2.partial", own / "stretched-1.bin.3.partial"
    for left in (old, young):
        left.write_bytes(b"begun")
    os.utime(old, (0, 0))
    _folder.cache_clear()  # as in the next process
    cached(stretched)(mesh, 2.0)
    assert not old.exists() and young.exists() and MADE == [2.0]


def test_only_the_results_used_last_are_kept(folder):
    mesh, keep = build_model("saloon_01"), cached_latest(2)(stretched)
    keep(mesh, 2.0)
    keep(mesh, 3.0)
    for age, path in enumerate(sorted(folder.rglob("*.bin"), key=lambda path: path.stat().st_mtime_ns)):
        os.utime(path, (1000 + age, 1000 + age))
    keep(mesh, 2.0)  # the older result, used again
    keep(mesh, 4.0)
    MADE.clear()
    for by in (2.0, 4.0, 3.0):
        keep(mesh, by)
    assert MADE == [3.0]


def test_arguments_that_follow_from_others_are_ignored(folder):
    mesh, keep = build_model("saloon_01"), cached_latest(2, ignore=("by",))(stretched)
    keep(mesh, by=2.0)
    keep(mesh, by=3.0)
    assert MADE == [2.0]


def large(factor: float) -> tuple[np.ndarray, np.ndarray]:
    MADE.append(factor)
    values = np.arange(300_000.0) * factor
    return values, values


def mapped_kb(array: np.ndarray) -> int:
    """Size of the file that is mapped at an array's address; 0 if there is none."""
    address = array.ctypes.data
    for line in Path("/proc/self/maps").read_text().splitlines():
        place, _, _, _, _, *path = line.split()
        first, last = (int(end, 16) for end in place.split("-"))
        if first <= address < last:
            return (last - first) // 1024 if path and "large" in path[0] else 0
    return 0


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_large_results_are_mapped_from_their_file(folder):
    keep = cached(large)
    made, again = keep(2.0), keep(2.0)
    assert MADE == [2.0]
    for values, same in (made, again):
        assert values is same and np.array_equal(values, np.arange(300_000.0) * 2)
        assert mapped_kb(values) > 2000
    assert [path.suffix for path in folder.rglob("large*")] == [".bin"]


def test_changed_arrays_do_not_change_what_is_stored(folder):
    keep = cached(large)
    keep(2.0)[0][:] = 0
    assert np.array_equal(keep(2.0)[0], np.arange(300_000.0) * 2) and MADE == [2.0]


def test_results_stay_readable_when_their_file_is_removed_or_replaced(folder):
    keep = cached(large)
    values, _ = keep(2.0)
    (path,) = folder.rglob("large*")
    path.unlink()
    assert np.array_equal(values, np.arange(300_000.0) * 2)
    values, _ = keep(2.0)
    other = path.with_suffix(".other")
    other.write_bytes(bytes(path.stat().st_size))
    other.replace(path)
    assert np.array_equal(values, np.arange(300_000.0) * 2)
    assert np.array_equal(keep(2.0)[0], values) and MADE == [2.0, 2.0, 2.0]


def test_files_without_several_names_are_read(folder, monkeypatch):
    def refuse(path, target):
        raise PermissionError("Operation not permitted")

    monkeypatch.setattr("pathlib.Path.hardlink_to", refuse)
    keep = cached(large)
    keep(2.0)
    values, _ = keep(2.0)
    assert MADE == [2.0] and np.array_equal(values, np.arange(300_000.0) * 2)
    values[:] = 0
    assert keep(2.0)[0][1] == 2.0


def test_a_full_disk_costs_only_time(folder, monkeypatch):
    def refuse(value, file):
        file.write(b"begun")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("assets.cache.dump", refuse)
    keep = cached(large)
    assert keep(2.0)[0][1] == 2.0 and keep(2.0)[0][1] == 2.0 and MADE == [2.0, 2.0]
    assert not list(folder.rglob("large*"))
