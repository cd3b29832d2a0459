"""What a user may get wrong, and the one line each mistake gets."""

import shutil

import pytest

from sumo_nets import TOWNS, TownError, read_town

_CONFIG = '<configuration><net-file value="a.net.xml"/></configuration>'


def _town(folder, net: bytes | None, config: str = _CONFIG):
    (folder / "a.sumocfg").write_text(config, encoding="utf-8")
    if net is not None:
        (folder / "a.net.xml").write_bytes(net)
    return folder / "a.sumocfg"


def _message(path) -> str:
    with pytest.raises(TownError) as caught:
        read_town(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_an_unknown_town_lists_the_available_ones():
    known = ", ".join(TOWNS)
    assert _message("town99") == f"town 'town99' does not exist; choose one of {known}, or give the path of a .sumocfg"


@pytest.mark.parametrize(
    ("net", "says"),
    [
        (b"not xml at all", "not well-formed"),
        (b"\x00\x01\x02\xff", "not well-formed"),
        (b"", "not well-formed"),
        (b'<?xml version="1.0"?><net><edge id="a">', "not well-formed"),
        (b'<!DOCTYPE net [<!ENTITY a "aaaa">]><net>&a;</net>', "DOCTYPE"),
        (b"<additional/>", "starts with <additional>"),
        (b"\x1f\x8b broken gzip", "cannot be read"),
        (None, "does not exist"),
    ],
)
def test_an_unusable_net_file_is_named(tmp_path, net, says):
    message = _message(_town(tmp_path, net))
    assert says in message
    assert "a.net.xml" in message


def test_a_truncated_town_is_refused(tmp_path, town):
    whole = town.net.read_bytes()
    assert "not well-formed" in _message(_town(tmp_path, whole[: len(whole) // 2]))


def test_a_net_that_sumo_refuses_is_refused(tmp_path, town):
    text = town.net.read_text(encoding="utf-8").replace('from="A0" to="A1"', 'from="A0" to="nowhere"', 1)
    assert "SUMO refuses it" in _message(_town(tmp_path, text.encode()))


def test_a_net_with_a_shape_that_lies_nowhere_is_refused(tmp_path, town):
    first = town.net.read_text(encoding="utf-8").split(' shape="', 1)
    shape, rest = first[1].split('"', 1)
    broken = first[0] + ' shape="' + shape.replace(shape.split(",", 1)[0], "1e300", 1) + '"' + rest
    assert "coordinate 1e+300 m" in _message(_town(tmp_path, broken.encode()))


def test_folders_need_one_configuration(tmp_path):
    assert "holds 0 .sumocfg files" in _message(tmp_path)
    _town(tmp_path, b"<net/>")
    shutil.copy(tmp_path / "a.sumocfg", tmp_path / "b.sumocfg")
    assert "holds 2 .sumocfg files" in _message(tmp_path)


def test_other_files_are_not_configurations(tmp_path, town):
    (tmp_path / "notes.txt").write_text("a town")
    assert "is not a .sumocfg" in _message(tmp_path / "notes.txt")
    assert read_town(town.net).streets_only  # a network file has only streets, for trajectories
    assert "names 0 networks" in _message(_town(tmp_path, None, "<configuration/>"))


@pytest.mark.parametrize(
    "area",
    [
        '<parkingArea id="p" lane="nowhere_0"/>',
        '<parkingArea id="p" lane="A0_A1_9"/>',
        '<parkingArea id="p" lane="A0_A1_1" startPos="soon"/>',
        '<parkingArea id="p" lane="A0_A1_1"><space x="here" y="0"/></parkingArea>',
    ],
)
def test_a_parking_area_that_cannot_be_placed_is_named(tmp_path, town, area):
    (tmp_path / "p.add.xml").write_text(f"<additional>{area}</additional>", encoding="utf-8")
    config = '<configuration><net-file value="a.net.xml"/><additional-files value="p.add.xml"/></configuration>'
    assert "parkingArea 'p'" in _message(_town(tmp_path, town.net.read_bytes(), config))
