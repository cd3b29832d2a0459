"""A recipe is a promise: the same recipe, the same bytes."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from pydantic import ValidationError

from assets.models.catalogue import CATALOGUE
from sumo_nets import RECIPES, TOWNS, Recipe, TownError, build_town, built_in_folder
from sumo_nets.recipe import Demand, GridLayout, RandomLayout, RingRoadLayout, SpiderLayout, StreetRules
from sumo_nets.tools import run_tool
from sumo_nets.town import read_town
from sumo_nets.vtypes import vtype_id

_MODELS = list(CATALOGUE.values() if isinstance(CATALOGUE, dict) else CATALOGUE)


def _assert_rebuilt(name, folder):
    build_town(RECIPES[name], folder)
    built = {path.name: path.read_bytes() for path in folder.iterdir()}
    kept = {path.name: path.read_bytes() for path in built_in_folder(name).iterdir()}
    assert built.keys() == kept.keys()
    assert [name for name in kept if built[name] != kept[name]] == []


@pytest.mark.parametrize("name", ["town06"])
def test_rebuilding_gives_the_committed_bytes(tmp_path, name):
    _assert_rebuilt(name, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(TOWNS) - {"town06"}))
def test_rebuilding_any_town_gives_the_committed_bytes(tmp_path, name):
    _assert_rebuilt(name, tmp_path)


def test_files_hold_no_dates_and_no_absolute_paths(town):
    for path in town.folder.iterdir():
        text = path.read_text(encoding="utf-8")
        assert "<!--" not in text
        assert str(town.folder) not in text


def test_every_model_has_a_vehicle_type_of_its_size(town):
    types = ET.parse(town.folder / "town01.add.xml").getroot().findall("vType")
    sizes = {t.get("id"): tuple(float(t.get(key, "nan")) for key in ("length", "width", "height")) for t in types}
    assert len(sizes) == len(types) and not any(t.get("vClass") == "tram" for t in types)
    for model in _MODELS:
        if model.kind in ("tram", "person_sitting"):  # the town has no tracks; SUMO has no persons that sit
            continue
        size = (model.length_m, model.width_m, model.height_m)
        assert sizes[vtype_id(model.body, *size)] == pytest.approx(size, abs=1e-9)


def test_cars_are_a_little_larger_than_the_boxes_of_kittis_labels(town):
    """28 742 labelled cars have 3.88 ± 0.43, 1.63 ± 0.10, 1.53 ± 0.14 m; annotators draw boxes too small."""
    root = ET.parse(town.folder / "town01.add.xml").getroot()
    types = {t.get("id"): t for t in root.findall("vType")}
    parked = next(d for d in root.findall("vTypeDistribution") if d.get("id") == "parked")
    chances = zip(parked.get("vTypes").split(), map(float, parked.get("probabilities").split()), strict=True)
    cars = [(types[name], chance) for name, chance in chances if types[name].get("vClass") == "passenger"]
    size = np.array([[float(t.get(key)) for key in ("length", "width", "height")] for t, _ in cars])
    weight = np.array([chance for _, chance in cars])
    mean = np.average(size, axis=0, weights=weight)
    spread = np.sqrt(np.average((size - mean) ** 2, axis=0, weights=weight))
    np.testing.assert_allclose(mean, [4.13, 1.70, 1.55], atol=0.03)
    np.testing.assert_allclose(spread, [0.45, 0.11, 0.13], atol=0.02)


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


def test_a_town_in_pieces_is_refused_in_one_line_and_leaves_nothing(tmp_path):
    island = RingRoadLayout(gates=(), ramps=(), services=(2,))
    with pytest.raises(TownError, match=r"town 'bad' is disconnected: \d+ of its \d+ streets") as caught:
        build_town(Recipe(name="bad", layout=island), tmp_path / "out")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_roundabouts_run_one_way_and_have_right_of_way(tmp_path):
    streets = StreetRules(roundabouts=1, main_lanes=1, signal_share=0)
    recipe = Recipe(name="round", layout=GridLayout(columns=3, rows=3, jitter_m=0), streets=streets)
    build_town(recipe, tmp_path)
    net = ET.parse(tmp_path / "round.net.xml").getroot()
    (circle,) = net.findall("roundabout")
    ring = circle.get("edges").split()
    assert len(ring) == 4
    edges = {edge.get("id"): int(edge.get("priority")) for edge in net.findall("edge") if not edge.get("function")}
    assert not {"_".join(reversed(edge.split("_"))) for edge in ring} & set(edges)
    assert min(edges[edge] for edge in ring) > max(p for edge, p in edges.items() if edge not in ring)


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"gates": (0, 9)}, "arm 9 does not exist"),
        ({"gates": (2,)}, "arm 2 has a gate and ramps"),
        ({"circles_m": (50.0, 250.0)}, "end 75 m within"),
    ],
)
def test_ring_roads_that_cannot_be_are_refused(values, says):
    with pytest.raises(ValidationError, match=says):
        RingRoadLayout(**values)


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


def test_a_tram_line_needs_streets_that_exist(tmp_path):
    recipe = RECIPES["town09"].model_copy(update={"tram_line": ("B2", "D3")})
    with pytest.raises(TownError, match="tram_line needs the street 'B2_D3'"):
        build_town(recipe, tmp_path)


def test_trams_without_tracks_are_refused(tmp_path):
    with pytest.raises(TownError, match="no loop of tram tracks"):
        build_town(RECIPES["town09"].model_copy(update={"tram_line": ()}), tmp_path)
