"""Files from strangers: whatever is in them, they are read, or refused in one line. `make fuzz` tries many more."""

import io
import os
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from assets.errors import AssetError
from assets.external import load_external
from cosim.drives.kitti.calibration import parse_calibration
from cosim.drives.kitti.labels import parse_labels
from cosim.drives.kitti.oxts import parse_oxts
from cosim.drives.kitti.rays import decode_rays
from cosim.drives.twin import read_glb
from cosim.drives.twin.frame import TwinFrame
from cosim.errors import CosimError, FormatError
from cosim.user_errors import user_errors
from sensors.errors import SensorError
from sensors.npz import NpzError, npz_arrays
from sensors.pattern import parse_pattern
from tests.fuzz.material import make_material
from tests.fuzz.point_variants import point_trial
from tests.fuzz.readers import READERS, Reader
from tests.fuzz.table_variants import table_trial
from tests.fuzz.trying import try_reader
from tests.fuzz.variants import try_variants

_TRIALS = {"net": 4, "parking": 4, "town": 15}


@pytest.fixture(scope="session")
def material(drive_folder, tmp_path_factory):
    folder = tmp_path_factory.mktemp("fuzz") / "material"
    make_material(drive_folder, folder)
    return folder


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.name)
def test_spoilt_files_are_read_or_refused_in_one_line(reader: Reader, material):
    tally = try_reader(reader, material, _TRIALS.get(reader.name, 40))
    assert not tally.crashes
    assert tally.refused > 0


@pytest.mark.parametrize("make_trial", [table_trial, point_trial])
def test_no_variant_is_read_wrongly_without_a_word(make_trial, tmp_path):
    outcome = try_variants(make_trial(tmp_path / "variants"), user_errors(), trials=40, seed=0)
    assert outcome.wrong == () and outcome.foreign == ()
    assert outcome.read > 8 and outcome.refused


@pytest.mark.parametrize("parse", [parse_labels, parse_calibration, parse_oxts, TwinFrame.from_json])
@given(text=st.text(max_size=300))
@settings(max_examples=60, deadline=None)
def test_any_text_is_read_or_refused(parse, text):
    try:
        parse(text)
    except CosimError as error:
        assert "\n" not in str(error)


@given(text=st.text(max_size=200))
@settings(max_examples=60, deadline=None)
def test_any_text_is_a_pattern_or_refused(text):
    with pytest.raises(SensorError):
        parse_pattern(text, origin="p.yaml")


@given(data=st.binary(max_size=400))
@settings(max_examples=100, deadline=None)
def test_any_bytes_are_an_archive_or_refused(data):
    with pytest.raises(FormatError):
        decode_rays(data)


def test_a_small_archive_that_unpacks_to_gigabytes_is_refused():
    target = io.BytesIO()
    with (
        zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("a.npy", "w", force_zip64=True) as file,
    ):
        for _ in range(1025):
            file.write(bytes(1 << 20))
    assert len(target.getvalue()) < 2 << 20
    with pytest.raises(NpzError, match="unpacks to more than 1024 MiB"):
        npz_arrays(target.getvalue())


def test_an_array_that_claims_to_be_huge_is_refused():
    member = io.BytesIO()
    np.lib.format.write_array_header_1_0(member, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w") as archive:
        archive.writestr("a.npy", member.getvalue() + bytes(80))
    with pytest.raises(NpzError, match="is not as long as it says"):
        npz_arrays(target.getvalue())


def test_python_objects_in_an_archive_are_refused(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, a=np.array([{"x": 1}], dtype=object))
    with pytest.raises(NpzError, match="Python objects"):
        npz_arrays(path.read_bytes())


def test_entities_in_a_vehicle_are_not_expanded(material, tmp_path):
    body = (material / "vehicles/box.dae").read_text()
    start = body.index("<COLLADA")
    entities = "".join(f'<!ENTITY e{n + 1} "{f"&e{n};" * 10}">' for n in range(12))
    bomb = f'<?xml version="1.0"?><!DOCTYPE COLLADA [<!ENTITY e0 "x">{entities}]>' + body[start:].replace(
        "<asset>", "<asset><keywords>&e12;</keywords>", 1
    )
    (tmp_path / "box.dae").write_text(bomb)
    (tmp_path / "vehicles.yaml").write_text("- {file: box.dae, class: truck, forward: x}\n")
    with pytest.raises(AssetError):
        load_external(tmp_path)


def test_a_world_cannot_open_files_elsewhere(tmp_path):
    (tmp_path / "secret.bin").write_bytes(os.urandom(36))
    inside = tmp_path / "twin"
    inside.mkdir()
    (inside / "static.gltf").write_text(
        '{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],'
        '"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],'
        '"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],'
        '"bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"uri":"../secret.bin","byteLength":36}]}'
    )
    with pytest.raises(FormatError, match="not a readable glTF file"):
        read_glb(inside / "static.gltf")
