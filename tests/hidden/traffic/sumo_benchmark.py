"""How well hidden behaviour is found in SUMO simulations: `python -m tests.hidden.traffic.sumo_benchmark`.

Networks are a grid, a ring with arms, a motorway with ramps and an irregular town. The user's configuration names the
network and `behaviour: sumo`; the table has no lanes. Finished cases are kept in `out/hidden/traffic_sumo`.
"""

from __future__ import annotations

import argparse
import json
import re
import resource
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tests.hidden.traffic.networks import build

_ROOT = Path(__file__).resolve().parents[3]


@dataclass(frozen=True)
class Case:
    """One recording: what the maker hides, true parameters by behaviour, and channels that show an unknown kind."""

    network: str
    hidden: dict[str, Any]
    truth: dict[str, dict[str, float]] = field(default_factory=dict)
    channels: tuple[str, ...] = ()
    vehicles: int = 220


_WITHOUT = {
    **{"accel_mps2": 2.6, "decel_mps2": 4.5, "factor": 1.0, "speed_ratio": 1.0, "delay_s": 0.0, "time_gap_s": 1.0},
    **{"speed_factor": 0.9925, "min_gap_m": 2.5, "lat_alignment_m": 0.0, "sigma": 0.5, "action_step_s": 0.1},
}
"""Parameters of the model."""
_CARS_AND_TRUCKS = 0.85 * 1.0 + 0.15 * 0.95  # mean speed factor of the maker's vehicles


def _one(network: str, name: str, key: str, strong: Any, half: Any, hide: Any) -> dict[str, Case]:
    return {
        f"strong-{name}": Case(network, hide(strong), {name: {key: strong} if key else {}}),
        f"half-{name}": Case(network, hide(half), {name: {key: half} if key else {}}),
    }


def _vtype(key: str) -> Any:
    return lambda value: {"vtype": {key: value}}


CASES: dict[str, Case] = (
    _one("grid", "acceleration_ability", "accel_mps2", 1.3, 1.9, _vtype("accel"))
    | _one("grid", "braking_ability", "decel_mps2", 2.0, 3.2, _vtype("decel"))
    | _one("town", "cornering", "lateral_mps2", 1.5, 3.0, lambda value: {"cornering_mps2": value})
    | _one("grid", "street_speed", "factor", 0.6, 0.8, lambda value: {"slow_quarter": value})
    | _one("grid", "driver_classes", "speed_ratio", 0.65, 0.82, lambda value: {"classes": [0.3, value]})
    | _one("grid", "startup_delay", "delay_s", 1.6, 0.8, _vtype("startupDelay"))
    | _one("ring", "gap_acceptance", "time_gap_s", 5.0, 3.0, _vtype("jmTimegapMinor"))
    | _one(
        *("town", "speeding", "speed_factor", 1.2 * _CARS_AND_TRUCKS, 1.1 * _CARS_AND_TRUCKS),
        lambda value: {"speed_ratio": value / _CARS_AND_TRUCKS},
    )
    | _one("grid", "short_gap", "min_gap_m", 4.0, 3.2, _vtype("minGap"))
    | _one("motorway", "lane_offset", "lat_alignment_m", 0.2, 0.1, lambda value: {"lateral": [value, 0.05]})
    | _one("motorway", "imperfection", "sigma", 0.9, 0.7, _vtype("sigma"))
    | _one("town", "reaction_time", "action_step_s", 1.0, 0.5, _vtype("actionStepLength"))
    | _one("grid", "lane_changing", "", 0.8, 0.4, lambda value: {"changes": value})
    | {
        "pair-speeding-lane_offset": Case(
            "grid",
            {"speed_ratio": 1.2, "lateral": [0.2, 0.05]},
            {"speeding": {"speed_factor": 1.2 * _CARS_AND_TRUCKS}, "lane_offset": {"lat_alignment_m": 0.2}},
        ),
        "pair-acceleration-short_gap": Case(
            "town",
            {"vtype": {"accel": 1.3, "minGap": 4.0}},
            {"acceleration_ability": {"accel_mps2": 1.3}, "short_gap": {"min_gap_m": 4.0}},
        ),
        "unknown-red": Case("grid", {"vtype": {"jmDriveAfterRedTime": 12}}, channels=("signals", "stops")),
        "unknown-brakes": Case("town", {"brakes_per_s": 0.06}, channels=("deceleration", "jerk", "speed")),
        "unknown-late": Case("motorway", {"late_ratio": 0.75}, channels=("speed",)),
        "unknown-stops": Case("grid", {"stops": 0.35}, channels=("stops", "speed", "deceleration")),
        "unknown-weaving": Case("motorway", {"weaving_m": 0.25}, channels=("lateral",)),
        "unknown-left": Case("motorway", {"vtype": {"lcKeepRight": 0}}, channels=("lane_changes",)),
        "unknown-swings": Case(
            "grid", {"swings": 0.12}, channels=("jerk", "speed", "acceleration", "deceleration", "reaction")
        ),
        "unknown-trucks": Case("motorway", {"truck": {"tau": 3.0, "minGap": 6}}, channels=("headway",)),
        "null-seed-1": Case("grid", {}),
        "null-seed-2": Case("town", {}),
        "null-seed-3": Case("motorway", {}),
        "null-seed-4": Case("ring", {}),
        "null-demand-1": Case("grid", {}, vehicles=330),
        "null-demand-2": Case("town", {}, vehicles=130),
        "null-noise": Case("grid", {"noise_m": 0.2}),
        "null-crop": Case("grid", {"crop_m": 260}),
        "null-sublane": Case("grid", {"options": ["--lateral-resolution", "0.8"]}),
        "null-shift": Case("grid", {"shift_s": 1_700_000_037.0}),
    }
)


def main() -> None:
    """Run what is not done yet, then print a line per case and the shares."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", default="", help="regular expression of case names")
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--folder", type=Path, default=Path("out/hidden/traffic_sumo"))
    parser.add_argument("--workers", type=int, default=2, help="processes that simulate")
    chosen = parser.parse_args()
    done = {}
    for name, case in CASES.items():
        if re.search(chosen.cases, name):
            done[name] = _result(chosen.folder.resolve() / f"{name}-{chosen.seed}", case, chosen.seed, chosen.workers)
            print(_line(name, case, done[name]), flush=True)
    _print_shares(done)


def _result(folder: Path, case: Case, seed: int, workers: int) -> dict[str, Any]:
    path = folder / "found.json"
    if not path.exists():
        from cosim.capture.config import RunConfig
        from cosim.driver_discrepancy import traffic_diagnose

        town = build(case.network, folder)
        task = {"folder": str(folder), "hidden": case.hidden, "seed": seed, "network": case.network}
        (folder / "task.json").write_text(json.dumps({**task, "vehicles": case.vehicles, "seconds": 90}))
        maker = [sys.executable, "-m", "tests.hidden.traffic.sumo_maker", str(folder / "task.json")]
        subprocess.run(maker, check=True, cwd=_ROOT)
        before = _cpu_s()
        config = RunConfig(town=str(town), behaviour="sumo")  # pyright: ignore[reportArgumentType]
        found = traffic_diagnose(folder / "measured.csv", config, workers=workers).to_json()
        path.write_text(json.dumps({**found, "cpu_s": _cpu_s() - before}, indent=1))
    return json.loads(path.read_text())


def _cpu_s() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def _judge(name: str, case: Case, result: dict[str, Any]) -> str:
    from cosim.driver_discrepancy.channels import CHANNELS

    names = [one["effect"] for one in result["effects"]]
    if name.startswith("null"):
        return "silent" if not names and not result["unexplained"] else "ALARM"
    if case.channels:
        groups = [CHANNELS[one["channel"]].group for one in result["unexplained"]]
        right = any(group in case.channels for group in groups)
        return ("right" if right else "WRONG" if names or groups else "MISSED") + (" +finding" if names else "")
    if names and names[0] in case.truth:
        return "exact" if set(names) == set(case.truth) else "first"
    if names:
        alternatives = {other for one in result["effects"] for other in one["also_possible"]}
        return "either-or" if alternatives & set(case.truth) else "WRONG"
    return "below" if _is_below(case, result) else "MISSED"


def _is_below(case: Case, result: dict[str, Any]) -> bool:
    """Whether the hidden change is smaller than the smallest one that the diagnosis says it would have detected."""
    smallest = result["smallest_detectable"]
    return any(
        key in _WITHOUT and smallest.get(name, {}).get(key, 0.0) > abs(true - _WITHOUT[key])
        for name, values in case.truth.items()
        for key, true in values.items()
    )


def _line(name: str, case: Case, result: dict[str, Any]) -> str:
    words = []
    for one in result["effects"]:
        for key, true in case.truth.get(one["effect"], {}).items():
            low, high = one["ci95"][key]
            inside = "in" if low <= true <= high else "OUT"
            words.append(f"{key} {one['params'][key]:.3g} [{low:.3g}, {high:.3g}] true {true:g} {inside}")
    names = ", ".join(one["effect"] for one in result["effects"]) or "–"
    left = ", ".join(f"{one['channel']}{one['covariates'] or ''}" for one in result["unexplained"])
    fall = f"{result['error_before']:.3f} → {result['error_after']:.3f} (floor {result['noise_floor']:.3f})"
    validated = _judge(name, case, result)
    return f"{name:30s} {validated:10s} {names:36s} {fall} {'; '.join(words)} | {left} | {result['cpu_s']:.0f} CPU s"


def _print_shares(done: dict[str, dict[str, Any]]) -> None:
    validated = {name: _judge(name, CASES[name], found) for name, found in done.items()}
    for kind, good in (
        ("strong", "exact|first"),
        ("half", "exact|first|below"),
        ("pair", "exact"),
        ("unknown", "right"),
    ):
        own = [word for name, word in validated.items() if name.startswith(kind)]
        print(f"{kind}: {sum(bool(re.match(good, word)) for word in own)} of {len(own)}")
    nulls = {name: found for name, found in done.items() if name.startswith("null")}
    silent = sum(validated[name] == "silent" for name in nulls)
    ratio = [found["error_before"] / found["noise_floor"] for found in nulls.values()]
    print(f"null: {silent} of {len(nulls)} silent; error over floor {np.round(ratio, 2).tolist()}")
    effects = [one for found in done.values() for one in found["effects"]]
    print(f"falls: {sum(one['error_after'] < one['error_before'] for one in effects)} of {len(effects)}")
    inside = [
        low <= true <= high
        for name, found in done.items()
        for one in found["effects"]
        for key, true in CASES[name].truth.get(one["effect"], {}).items()
        for low, high in [one["ci95"][key]]
    ]
    print(f"intervals: {sum(inside)} of {len(inside)} cover")
    print(f"CPU: median {np.median([found['cpu_s'] for found in done.values()]):.0f} s")


if __name__ == "__main__":
    main()
