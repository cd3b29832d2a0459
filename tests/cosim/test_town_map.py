"""The page of towns."""

import re
import xml.etree.ElementTree as ET

import pytest

from cosim.cli.main import main
from cosim.town_map.drawing import town_svg
from cosim.town_map.facts import town_facts
from sumo_nets import read_town


@pytest.fixture(scope="module")
def town():
    return read_town("town02")


def test_a_drawing_is_whole_xml_with_every_kind_of_part(town):
    svg = ET.fromstring(town_svg(town.streets))
    tags = {element.tag.rpartition("}")[2] for element in svg.iter()}
    assert {"svg", "image", "path", "circle", "text"} <= tags


def test_facts_agree_with_the_streets(town):
    facts = town_facts(town)
    assert facts.parking_lots == len(town.streets.parking)
    assert sum(facts.limits_km.values()) == pytest.approx(facts.lane_km)
    assert facts.lights == 0
    assert 0 < facts.max_grade_percent <= 8


def test_the_page_needs_nothing_else(tmp_path):
    assert main(["towns", "show", "--town", "town02", "--out", str(tmp_path), "--quiet"]) == 0
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert [path.name for path in tmp_path.iterdir()] == ["index.html"]
    assert not re.findall(r'(?:src|href)="(?!data:)', text)
    assert "<script" not in text


def test_an_unknown_town_is_one_line(capsys):
    assert main(["towns", "show", "--town", "town99"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
