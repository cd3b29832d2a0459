"""A hidden driver behaviour of a SUMO simulation is found, with its size; the loop writes its findings."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import yaml

from tests.hidden.traffic.town import BEHAVIOUR, build_town

_ROOT = Path(__file__).resolve().parents[3]


def measured(folder: Path, hidden: dict, seed: int, seconds: float = 40, drivers: int = 24) -> tuple[Path, Path]:
    """A measured CSV file, and the configuration of a user who knows nothing of what is hidden."""
    town, out, config = build_town(folder / "town", crossings=3), folder / "measured.csv", folder / "run.yaml"
    task = {"config": str(town), "out": str(out), "hidden": hidden, "seed": seed, "drivers": drivers}
    (folder / "task.json").write_text(json.dumps({**task, "parked": 12, "seconds": seconds, "step_s": 0.2}))
    maker = [sys.executable, "-m", "tests.hidden.traffic.maker", str(folder / "task.json")]
    subprocess.run(maker, check=True, cwd=_ROOT)
    config.write_text(yaml.safe_dump({"town": str(town), "step_s": 0.2, "behaviour": BEHAVIOUR}))
    return out, config


def test_a_hidden_lateral_offset_is_detected_and_written(tmp_path: Path, capsys) -> None:
    from cosim.cli import main

    csv, config = measured(tmp_path, {"offset": (0.2, 0.05)}, seed=5)
    command = ["traffic-diagnose", str(csv), "--config", str(config), "--seeds", "4", "--workers", "1"]
    assert main([*command, "--out", str(tmp_path / "page"), "--json", str(tmp_path / "found.json")]) == 0
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["verdict"] == "missing"
    assert [one["effect"] for one in found["effects"]] == ["lane_offset"]
    assert found["effects"][0]["params"]["lat_alignment_m"] == pytest.approx(0.2, abs=0.03)
    assert found["error_after"] < found["error_before"]
    assert "lane_offset" in capsys.readouterr().out
    better = yaml.safe_load((tmp_path / "page/config.yaml").read_text())["behaviour"]["lane_offset_m"]
    assert (better["min"] + better["max"]) / 2 == pytest.approx(0.2, abs=0.03)
    assert "<script" not in (tmp_path / "page/index.html").read_text()


@pytest.mark.slow
def test_simulations_whose_process_dies_are_done_again(tmp_path: Path) -> None:
    from cosim.driver_discrepancy.case import open_case

    csv, config = measured(tmp_path, {}, seed=5, seconds=20, drivers=12)
    statistics, seeds = [], range(3)
    for killed in (False, True):
        with open_case(csv, config, workers=1) as case, ThreadPoolExecutor(1) as beside:
            case.simulations.run([(case.behaviour, 9)])  # its process has started
            running = beside.submit(case.simulations.run, [(case.behaviour, seed) for seed in seeds])
            if killed:
                (worker,) = multiprocessing.active_children()
                os.kill(worker.pid or 0, signal.SIGKILL)
            statistics.append([summary.statistics() for summary in running.result()])
    assert repr(statistics[0]) == repr(statistics[1])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hidden", "effect"),
    [
        ({"speed": (1.2, 0.05)}, "speeding"),
        ({"gap": (0.7, 0.3), "tau": (0.8, 0.1)}, "short_gap"),
        ({"change_per_edge": 0.8}, "lane_changing"),
        ({"u_turn_share": 0.1}, "u_turns"),
        ({"leaves_per_min": 6.0}, "parked_pull_out"),
        ({"sigma": 0.9}, "imperfection"),
        ({"action_s": 0.8}, "reaction_time"),
        ({}, None),
    ],
)
def test_hidden_habits_are_named(tmp_path: Path, hidden: dict, effect: str | None) -> None:
    from cosim.driver_discrepancy import traffic_diagnose

    csv, config = measured(tmp_path, hidden, seed=6, seconds=90, drivers=40)
    found = traffic_diagnose(csv, config, workers=2)
    assert [one.behaviour for one in found.effects] == ([effect] if effect else [])
