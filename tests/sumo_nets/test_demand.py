"""A fresh population for every episode."""

import os
import subprocess
import xml.etree.ElementTree as ET
from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from sumo_nets import RECIPES, Demand, DemandConfig, KindShares, TownError, read_town, write_demand
from sumo_nets.tools import sumo_home
from sumo_nets.type_table import read_types

_SMALL = Demand(driving=30, parked=25, walking=12, duration_s=120)


def _people(config):
    root = ET.parse(config.with_suffix("").with_suffix(".rou.xml")).getroot()
    return {element.get("id"): element.get("type") for element in root}


def test_the_population_is_the_one_requested(town, tmp_path):
    ids = list(_people(write_demand(town, _SMALL, 5, tmp_path)))
    counts = Counter(name.rstrip("0123456789") for name in ids)
    assert counts == {"veh": 30, "parked": 25, "ped": 12}


def test_a_seed_gives_the_same_bytes_and_another_another_population(town, tmp_path):
    def files(seed, name):
        folder = write_demand(town, _SMALL, seed, tmp_path / name).parent
        return [path.read_bytes() for path in sorted(folder.iterdir())]

    assert files(1, "a") == files(1, "b")
    assert files(1, "a") != files(2, "c")


def test_no_more_vehicles_park_than_there_are_lots(town, tmp_path):
    crowd = Demand(driving=1, parked=5000, walking=0, duration_s=10)
    names = _people(write_demand(town, crowd, 0, tmp_path))
    assert sum(name.startswith("parked") for name in names) == len(town.streets.parking)


def test_types_follow_their_shares(town, tmp_path):
    shares = KindShares(car=0.5, van=0, truck=0.3, bus=0, motorcycle=0, cyclist=0.2)
    demand = Demand(driving=400, parked=0, walking=0, duration_s=1, kinds=shares)
    types = read_types(town.additional).kinds
    counts = Counter(types[name] for name in _people(write_demand(town, demand, 3, tmp_path)).values())
    assert set(counts) == {"car", "truck", "cyclist"}
    for kind, share in (("car", 0.5), ("truck", 0.3), ("cyclist", 0.2)):
        assert counts[kind] / 400 == pytest.approx(share, abs=4 * np.sqrt(share * (1 - share) / 400))


def test_sumo_runs_it_from_any_folder(town, tmp_path):
    config = write_demand(town, _SMALL, 7, tmp_path)
    done = subprocess.run(
        [str(sumo_home() / "bin" / "sumo"), "-c", str(config), "--end", "20"],
        capture_output=True,
        text=True,
        cwd="/",
        env={**os.environ, "SUMO_HOME": str(sumo_home())},
    )
    assert done.returncode == 0, done.stderr
    assert "Error" not in done.stderr


def test_a_town_without_types_says_so(tmp_path):
    (tmp_path / "a.add.xml").write_text("<additional/>", encoding="utf-8")
    with pytest.raises(TownError, match="no vType"):
        read_types((tmp_path / "a.add.xml",))


@given(seed=st.integers(0, 2**32 - 1))
def test_draws_stay_within_their_ranges_and_repeat(seed):
    usual = RECIPES["town01"].demand
    config = DemandConfig(driving=(20, 40), parked_factor=(0.5, 0.75), walking=7)
    drawn = config.draw(usual, np.random.default_rng(seed))
    assert drawn == config.draw(usual, np.random.default_rng(seed))
    assert 20 <= drawn.driving <= 40
    assert 0.5 * usual.parked - 1 <= drawn.parked <= 0.75 * usual.parked + 1
    assert drawn.walking == 7
    assert drawn.duration_s == usual.duration_s


def test_types_without_spread_are_the_ones_given():
    types = KindShares(car=1, truck=2)
    drawn = DemandConfig(kinds=types, kind_spread=0).draw(Demand(), np.random.default_rng(0))
    assert drawn.kinds == types


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"driving": (30, 20)}, "minimum 30 is above maximum 20; write \\[20, 30\\]"),
        ({"parked": (-1, 20)}, "minimum -1 is negative"),
        ({"walking_factor": (0.1, float("inf"))}, "is not finite"),
        ({"driving": 0}, "the ego vehicle is one of them"),
        ({"kinds": {"car": 0, "van": 0, "truck": 0, "bus": 0, "motorcycle": 0, "cyclist": 0}}, "all shares are 0"),
        ({"kinds": {"tram": 1}}, "tram"),
        ({"drivers": 3}, "drivers"),
    ],
)
def test_impossible_distributions_are_refused(values, says):
    with pytest.raises(ValidationError, match=says):
        DemandConfig(**values)


def test_trams_drive_where_the_town_has_tracks(tmp_path):
    usual = RECIPES["town09"].demand
    drawn = DemandConfig(trams=3).draw(usual, np.random.default_rng(0))
    assert drawn.trams == 3 and DemandConfig().draw(usual, np.random.default_rng(0)).trams == usual.trams > 0
    assert DemandConfig(trams=3).draw(RECIPES["town01"].demand, np.random.default_rng(0)).trams == 0
    town = read_town("town09")
    tracked = {lane.edge for lane in town.streets.lanes if lane.tracks}
    config = write_demand(town, _SMALL.model_copy(update={"trams": 3}), 5, tmp_path)
    root = ET.parse(config.with_suffix(".rou.xml")).getroot()
    routes = [v.find("route").get("edges").split() for v in root if v.get("id").startswith("tram")]
    assert len(routes) == 3 and all(tracked >= set(route) and len(route) > 5 for route in routes)


def test_trams_do_not_change_other_road_users(tmp_path):
    town = read_town("town09")
    without, with_trams = (
        _people(write_demand(town, _SMALL.model_copy(update={"trams": n}), 5, tmp_path / str(n))) for n in (0, 2)
    )
    assert {name: kind for name, kind in with_trams.items() if not name.startswith("tram")} == without


@pytest.mark.parametrize("sitting", [(0.2, 1.5), -0.1])
def test_shares_of_seats_are_between_0_and_1(sitting):
    with pytest.raises(ValidationError):
        DemandConfig(sitting=sitting)
