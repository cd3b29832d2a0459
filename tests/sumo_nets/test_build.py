"""A recipe is a promise: the same recipe, the same bytes."""

import xml.etree.ElementTree as ET

import pytest
from pydantic import ValidationError

from assets.models.catalogue import CATALOGUE
from sumo_nets import RECIPES, Recipe, TownError, build_town
from sumo_nets.recipe import Demand, RandomLayout, SpiderLayout
from sumo_nets.tools import run_tool
from sumo_nets.town import read_town
from sumo_nets.vtypes import vtype_id

_MODELS = list(CATALOGUE.values() if isinstance(CATALOGUE, dict) else CATALOGUE)


def test_rebuilding_gives_the_committed_bytes(tmp_path, town):
    build_town(RECIPES["town01"], tmp_path)
    built = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    kept = {path.name: path.read_bytes() for path in town.folder.iterdir()}
    assert built.keys() == kept.keys()
    assert [name for name in kept if built[name] != kept[name]] == []


def test_files_hold_no_dates_and_no_absolute_paths(town):
    for path in town.folder.iterdir():
        text = path.read_text(encoding="utf-8")
        assert "<!--" not in text
        assert str(town.folder) not in text


def test_every_model_has_a_vehicle_type_of_its_size(town):
    types = ET.parse(town.folder / "town01.add.xml").getroot().findall("vType")
    sizes = {t.get("id"): tuple(float(t.get(key, "nan")) for key in ("length", "width", "height")) for t in types}
    assert len(sizes) == len(types)
    for model in _MODELS:
        size = (model.length_m, model.width_m, model.height_m)
        assert sizes[vtype_id(model.body, *size)] == pytest.approx(size, abs=1e-9)
    assert len(sizes) == len({(m.body, m.length_m, m.width_m, m.height_m) for m in _MODELS})


@pytest.mark.parametrize("layout", [SpiderLayout(arms=5, circles=2), RandomLayout(iterations=20)])
def test_other_layouts_build_and_read(tmp_path, layout):
    demand = Demand(driving=5, parked=5, walking=5, duration_s=60)
    config = build_town(Recipe(name="other", layout=layout, demand=demand), tmp_path)
    assert read_town(config).streets.lanes


def test_a_layout_without_streets_is_refused_and_leaves_nothing(tmp_path):
    recipe = Recipe(name="bad", layout=RandomLayout(spacing_m=(200, 100)))
    with pytest.raises(TownError, match="made no streets"):
        build_town(recipe, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_the_first_error_of_a_tool_is_one_line():
    with pytest.raises(TownError) as caught:
        run_tool("netconvert", "--node-files", "missing.nod.xml", "-o", "out.net.xml")
    assert str(caught.value).startswith("netconvert failed: ")
    assert "missing.nod.xml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_recipes_refuse_unknown_keys_and_silly_values():
    with pytest.raises(ValidationError):
        Recipe.model_validate({"name": "x", "colour": "red"})
    with pytest.raises(ValidationError):
        Recipe(name="x", demand=Demand(driving=-1))
