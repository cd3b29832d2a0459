"""Cached values equal newly computed ones."""

from __future__ import annotations

import os

import numpy as np
import pytest

from assets.cache import FOLDER, cached, cached_latest
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
    for path in folder.rglob("*.npz"):
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


def test_only_the_results_used_last_are_kept(folder):
    mesh, keep = build_model("saloon_01"), cached_latest(2)(stretched)
    keep(mesh, 2.0)
    keep(mesh, 3.0)
    for age, path in enumerate(sorted(folder.rglob("*.npz"), key=lambda path: path.stat().st_mtime_ns)):
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
