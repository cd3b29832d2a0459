"""Scenarios of other people: all that they simulate is taken over, nothing that they write."""

import gzip
import subprocess

import pytest

from sumo_nets import TownError, read_town
from sumo_nets.tools import run_tool, sumo_home

ROUTES = """<routes>
    <vType id="own" vClass="passenger" minGap="5" tau="2.5" speedFactor="0.7"/>
    <flow id="f" type="own" from="{edge}" to="{edge}" begin="0" end="100" period="10"/>
</routes>"""


@pytest.fixture(scope="module")
def net(tmp_path_factory):
    path = tmp_path_factory.mktemp("net") / "own.net.xml"
    run_tool("netgenerate", "--grid", "--grid.number", "2", "--grid.length", "100", "--tls.guess", "-o", path)
    return path


def scenario(folder, net, options="", additional="", routes=""):
    folder.mkdir(exist_ok=True)
    (folder / "own.net.xml").write_bytes(net.read_bytes())
    (folder / "own.rou.xml").write_text(routes or ROUTES.format(edge="A0A1"))
    (folder / "own.add.xml").write_text(additional or "<additional/>")
    config = folder / "own.sumocfg"
    config.write_text(
        '<configuration><net-file value="own.net.xml"/><route-files value="own.rou.xml"/>'
        f'<additional-files value="own.add.xml"/>{options}</configuration>'
    )
    return config


def simulate(town, folder, seconds=20):
    """Run SUMO on the prepared scenario; return all new files."""
    config = town.runnable(folder)
    given = {path for path in (*folder.rglob("*"), *town.folder.rglob("*"))}
    command = [sumo_home() / "bin" / "sumo", "-c", config, "--end", str(seconds), "--no-step-log"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return {path for path in (*folder.rglob("*"), *town.folder.rglob("*"))} - given


@pytest.mark.parametrize(
    "option",
    [
        '<summary-output value="../written.xml"/>',
        '<output><fcd-output value="x.xml"/><tripinfo-output value="y.xml"/></output>',
        '<report><log value="x"/></report>',
        '<save-state.times value="5"/><save-state.prefix value="x"/>',
        '<device.ssm.probability value="1"/>',
        '<device.rerouting.probability value="1"/><device.rerouting.output value="r.xml"/>',
        '<traci_server><remote-port value="9999"/></traci_server>',
        '<l value="x"/>',
    ],
)
def test_outputs_and_ports_of_a_configuration_are_left_out_and_said(tmp_path, net, option):
    town = read_town(scenario(tmp_path / "own", net, option))
    assert any("left out" in note for note in town.notes)
    assert simulate(town, tmp_path / "run") == set()


@pytest.mark.parametrize(
    "element",
    [
        '<edgeData id="e" file="../written.xml"/>',
        '<inductionLoop id="e" lane="A0A1_0" pos="1" period="1" file="x.xml"/>',
        '<laneAreaDetector id="e" lane="A0A1_0" pos="1" endPos="20" period="1" file="x.xml"/>',
        '<timedEvent type="SaveTLSStates" source="A1" dest="x.xml"/>',
        '<vTypeProbe id="p" type="own" period="1" file="x.xml"/>',
        '<calibrator id="c" edge="A0A1" pos="0" output="x.xml"/>',
        '<vType id="s"><param key="has.ssm.device" value="true"/><param key="device.ssm.file" value="x.xml"/></vType>',
    ],
)
def test_elements_that_write_are_left_out_and_said(tmp_path, net, element):
    town = read_town(scenario(tmp_path / "own", net, additional=f"<add>{element}</add>"))
    assert any("left out" in note for note in town.notes)
    assert simulate(town, tmp_path / "run") == set()


def test_a_detector_stays_for_the_signals_that_look_at_it(tmp_path, net):
    element = '<inductionLoop id="seen" lane="A0A1_0" pos="1" period="1" file="x.xml"/>'
    town = read_town(scenario(tmp_path / "own", net, additional=f"<a>{element}</a>"))
    (path,) = town.runnable_additional(tmp_path)
    assert 'id="seen"' in path.read_text()
    assert "x.xml" not in path.read_text()


def test_rerouters_signals_and_variable_limits_stay_as_they_are(tmp_path, net):
    kept = (
        '<rerouter id="r" edges="A0A1"><interval begin="0" end="9"><destProbReroute id="A1A0"/></interval></rerouter>'
        '<variableSpeedSign id="v" lanes="A0A1_0"><step time="0" speed="5"/></variableSpeedSign>'
    )
    town = read_town(scenario(tmp_path / "own", net, additional=f"<additional>{kept}</additional>"))
    assert town.notes == ()
    assert town.runnable_additional(tmp_path) == town.additional
    assert simulate(town, tmp_path / "run") == set()


def test_options_that_decide_the_traffic_are_kept(tmp_path, net):
    town = read_town(
        scenario(tmp_path / "own", net, '<begin value="7"/><processing><collision.action value="none"/></processing>')
    )
    text = town.runnable(tmp_path / "run").read_text()
    assert '<begin value="7"/>' in text
    assert '<collision.action value="none"/>' in text


@pytest.mark.parametrize(
    "option",
    [
        '<report><duration-log.disable value="true"/><no-step-log value="true"/></report>',
        '<report><duration-log.statistics value="true"/><step-log.period value="100"/></report>',
        '<no-duration-log value="true"/>',
        '<log.timestamps value="true"/>',
        '<device.driverstate.probability value="0.1"/>',
    ],
)
def test_how_much_is_logged_and_how_attentive_drivers_are_needs_no_note(tmp_path, net, option):
    town = read_town(scenario(tmp_path / "own", net, option))
    assert town.notes == ()
    assert simulate(town, tmp_path / "run") == set()


def test_an_option_of_another_build_of_sumo_is_said(tmp_path, net):
    town = read_town(scenario(tmp_path / "own", net, '<osg-view value="true"/>'))
    assert "osg-view (unknown to this SUMO)" in town.notes[0]


def test_files_within_the_folder_are_included_without_what_they_write(tmp_path, net):
    folder = tmp_path / "own"
    config = scenario(folder, net, additional='<additional><include href="more.xml"/></additional>')
    (folder / "more.xml").write_text('<a><edgeData id="e" file="x.xml"/><poi id="p" x="0" y="0"/></a>')
    town = read_town(config)
    (path,) = town.runnable_additional(tmp_path)
    assert 'id="p"' in path.read_text()
    assert "edgeData" not in path.read_text()


@pytest.mark.parametrize(
    ("element", "says"),
    [
        ('<include href="/etc/passwd"/>', "outside"),
        ('<include href="nowhere.xml"/>', "does not exist"),
        ('<rerouter id="r" edges="A0A1" file="/etc/passwd"/>', "outside"),
        ('<include href="own.add.xml"/>', "include each other"),
    ],
)
def test_files_outside_the_folder_are_refused(tmp_path, net, element, says):
    with pytest.raises(TownError, match=says) as caught:
        read_town(scenario(tmp_path / "own", net, additional=f"<add>{element}</add>"))
    assert "\n" not in str(caught.value)


def test_other_configurations_are_refused(tmp_path, net):
    with pytest.raises(TownError, match="another configuration"):
        read_town(scenario(tmp_path / "own", net, '<configuration-file value="other.sumocfg"/>'))


def test_zipped_files_are_cleaned_too(tmp_path, net):
    folder = tmp_path / "own"
    config = scenario(folder, net, '<additional-files value="z.add.xml.gz"/>')
    (folder / "z.add.xml.gz").write_bytes(gzip.compress(b'<add><edgeData id="e" file="x.xml"/></add>'))
    town = read_town(config)
    assert simulate(town, tmp_path / "run") == set()


def test_a_network_of_rails_alone_carries_no_sensors(tmp_path, net):
    rails = net.read_text().replace('<lane id="', '<lane allow="rail" id="')
    rails = rails.replace('disallow="', 'data="').encode()
    (tmp_path / "rail.net.xml").write_bytes(rails)
    with pytest.raises(TownError, match="no lane for road vehicles"):
        read_town(scenario(tmp_path / "own", tmp_path / "rail.net.xml"))


def test_where_one_drives_on_the_left_the_middle_of_the_street_is_to_the_right(tmp_path):
    path = tmp_path / "left.net.xml"
    run_tool("netgenerate", "--grid", "--grid.number", "2", "--grid.length", "100", "--lefthand", "-o", path)
    town = read_town(scenario(tmp_path / "own", path))
    assert town.streets.left_hand
    lane = next(one for one in town.streets.lanes if one.id == "A0A1_0")
    assert lane.centre[0, 0] < 0  # north along x = 0, on the left


def read_or_refused(paths) -> None:
    for path in paths:
        try:
            assert read_town(path).streets.lanes
        except TownError as error:
            assert "no lane for road vehicles" in str(error)
            assert "\n" not in str(error)


def test_small_scenarios_of_sumos_own_package_are_read_or_refused_in_one_line():
    large = ("DRT*", "bs3*", "A10KW*")
    found = sorted((sumo_home() / "tools" / "game").glob("*.sumocfg"))
    small = [path for path in found if not any(path.match(name) for name in large)]
    assert len(small) >= 9
    read_or_refused(small)


@pytest.mark.slow
def test_every_scenario_of_sumos_own_package_is_read_or_refused_in_one_line():
    found = sorted((sumo_home() / "tools" / "game").rglob("*.sumocfg"))
    assert len(found) > 10
    read_or_refused(found)
