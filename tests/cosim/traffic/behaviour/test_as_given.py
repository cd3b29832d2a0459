"""`behaviour: sumo`: a scenario's own drivers drive as their vTypes say."""

import numpy as np
import pytest

from cosim.capture.config import ConfigError, RunConfig, load_config
from cosim.traffic.behaviour import BehaviourConfig
from cosim.traffic.driven_traffic import DrivenTraffic
from cosim.traffic.simulation import Traffic
from tests.cosim.traffic.behaviour.scenario import write_scenario

MIN_GAP_M, TAU_S, FACTOR, LIMIT_MPS, SLOW_MPS = 5.0, 2.5, 0.7, 20.0, 8.0

NODES = [f'<node id="{i}" x="{1500 * i}" y="0"/>' for i in range(3)]
EDGES = [f'<edge id="{name}" from="{i}" to="{i + 1}" numLanes="1" speed="{LIMIT_MPS}"/>' for i, name in enumerate("ab")]
TYPES = (
    f'<vType id="own" minGap="{MIN_GAP_M}" tau="{TAU_S}" speedFactor="{FACTOR}" sigma="0" length="4.5"/>'
    f'<vType id="slow" maxSpeed="{SLOW_MPS}" sigma="0" length="4.5"/>'
)
PLATOON = (
    '<vehicle id="leader" type="slow" depart="0" departPos="120"><route edges="a b"/>'
    '<stop lane="b_0" endPos="100" duration="60"/></vehicle>'
    + "".join(
        f'<vehicle id="own{i}" type="own" depart="0" departPos="{100 - 20 * i}"><route edges="a b"/></vehicle>'
        for i in range(3)
    )
)
ALONE = '<vehicle id="own0" type="own" depart="0"><route edges="a b"/></vehicle>'


def drive(folder, traffic_xml: str, behaviour: str, seconds: int):
    """Places (t, n) and speeds (t, n) of all vehicles by name, every second."""
    config = write_scenario(folder, NODES, EDGES, [TYPES, traffic_xml])
    settings = BehaviourConfig.model_validate(behaviour)
    found: dict[str, list[tuple[float, float]]] = {}
    with Traffic(config, seed=1, as_given=settings.as_given) as traffic:
        living = DrivenTraffic(traffic, settings, seed=1)
        for _ in range(seconds):
            actors = living.advance(10)
            for name, front, speed in zip(actors.ids, actors.front, actors.speed_mps, strict=True):
                found.setdefault(name, []).append((float(front[0]), float(speed)))
    return {name: np.array(values) for name, values in found.items()}


def test_headway_and_gap_are_those_of_the_vtype(tmp_path):
    ways = drive(tmp_path, PLATOON, "sumo", seconds=250)
    for ahead, behind in (("leader", "own0"), ("own0", "own1"), ("own1", "own2")):
        gap = ways[ahead][-len(ways[behind]) :, 0] - 4.5 - ways[behind][:, 0]
        cruises = slice(60, 150)
        headway = (gap[cruises] - MIN_GAP_M) / ways[behind][cruises, 1]
        assert np.median(headway) == pytest.approx(TAU_S, rel=0.05)
        stand = gap[(ways[behind][:, 1] < 0.05) & (np.arange(len(gap)) > 150)]
        assert np.median(stand) == pytest.approx(MIN_GAP_M, rel=0.05)


def test_the_speed_factor_is_that_of_the_vtype(tmp_path):
    ways = drive(tmp_path, ALONE, "sumo", seconds=100)
    assert np.median(ways["own0"][50:, 1]) == pytest.approx(FACTOR * LIMIT_MPS, rel=0.05)


def test_other_presets_have_drivers_of_their_own(tmp_path):
    ways = drive(tmp_path, ALONE, "calm", seconds=100)
    assert np.median(ways["own0"][50:, 1]) == pytest.approx(LIMIT_MPS, rel=0.05)


DECIDES_S = 0.5
FAR_AHEAD = (
    '<vType id="sensors" sigma="0" length="4.5"/>'
    f'<vType id="own" speedFactor="{FACTOR}" actionStepLength="{DECIDES_S}" sigma="0" length="4.5"/>'
    '<vehicle id="ego" type="sensors" depart="0" departPos="50"><route edges="a b"/></vehicle>'
    '<vehicle id="far" type="own" depart="0" departPos="700"><route edges="a b"/>'
    '<stop lane="a_0" endPos="1000" duration="900"/></vehicle>'
    '<person id="rider" depart="triggered"><ride from="a" to="b" lines="far"/></person>'
)


@pytest.mark.parametrize("behaviour", ["sumo", "calm"])
def test_who_was_far_from_the_sensors_is_as_the_scenario_has_him_once_he_is_near(tmp_path, behaviour):
    config = write_scenario(tmp_path, NODES, EDGES, [FAR_AHEAD])
    settings = BehaviourConfig.model_validate(behaviour)
    with Traffic(config, seed=1, as_given=settings.as_given) as traffic:
        living = DrivenTraffic(traffic, settings, seed=1)
        living.advance(10)
        api = traffic.api.vehicle
        factor = api.getSpeedFactor("far")
        living.follow("ego")
        actors = living.advance(10)
        assert traffic.far == {"far"} and api.getPersonIDList("far") == ("rider",)
        assert actors.ids == ("ego",) and living.everyone(actors).ids == ("ego", "far")
        if settings.as_given:
            assert (api.getSpeedFactor("far"), api.getActionStepLength("far")) == (factor, DECIDES_S)
        for _ in range(60):
            if "far" in actors.ids:
                break
            actors = living.advance(10)
        assert actors.ids == ("ego", "far")
        assert api.getActionStepLength("far") == DECIDES_S


TAXIS = (
    '<vType id="cab" vClass="taxi" length="4.5"><param key="has.taxi.device" value="true"/></vType>'
    '<vType id="tram" vClass="tram" length="20"/>'
    '<vehicle id="cab" type="cab" depart="0" departPos="50"><route edges="a b"/></vehicle>'
    '<person id="rider" depart="1" departPos="900"><ride from="a" to="b" lines="taxi"/></person>'
    '<vType id="train" vClass="rail" length="60"/>'
    '<vehicle id="tram" type="tram" depart="5" departPos="50"><route edges="a b"/>'
    '<stop lane="a_0" endPos="70" duration="900" parking="true"/></vehicle>'
    '<vehicle id="train" type="train" depart="60" departPos="100"><route edges="a b"/></vehicle>'
)


@pytest.mark.parametrize("behaviour", ["sumo", "paper"])
def test_taxis_fetch_those_who_call_them_trams_stop_and_trains_are_left_out(tmp_path, behaviour):
    config = write_scenario(tmp_path, NODES, EDGES, [TAXIS])
    settings = BehaviourConfig.model_validate(behaviour)
    with Traffic(config, seed=1, as_given=settings.as_given) as traffic:
        living = DrivenTraffic(traffic, settings, seed=1)
        carried, seen = False, set()
        for _ in range(200):
            actors = living.advance(10)
            seen |= set(zip(actors.ids, actors.kinds, strict=True))
            carried |= traffic.api.vehicle.getPersonIDList("cab") == ("rider",)
            if carried:
                break
        assert carried and actors.ids == ("cab", "tram") and traffic.dispatched("cab")
        assert seen == {("cab", "car"), ("rider", "pedestrian"), ("tram", "tram")}
        assert actors.parked[1] and traffic.api.vehicle.getLength("tram") == 20


def test_the_preset_stands_alone(tmp_path):
    path = tmp_path / "c.yaml"
    path.write_text("behaviour: {preset: sumo, collisions_per_min: 1}\n")
    with pytest.raises(ConfigError, match="collisions_per_min would change them") as caught:
        load_config(path)
    assert "\n" not in str(caught.value)


def test_the_preset_survives_a_drives_settings():
    config = RunConfig.model_validate({"behaviour": "sumo"})
    assert RunConfig.model_validate(config.model_dump(mode="json")) == config
