"""How well hidden habits of drivers are found: `python -m tests.hidden.traffic.benchmark`.

Finished cases are kept in `out/hidden/traffic` and not run again.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from tests.hidden.traffic.town import BEHAVIOUR, build_town

_ROOT = Path(__file__).resolve().parents[3]
_ONE: dict[str, tuple[dict, dict[str, dict[str, float]]]] = {
    "speeding": ({"speed": (1.2, 0.05)}, {"speeding": {"speed_factor": 1.2}}),
    "short_gap": ({"gap": (0.7, 0.3), "tau": (0.8, 0.1)}, {"short_gap": {"min_gap_m": 0.7, "tau_s": 0.8}}),
    "lane_offset": ({"offset": (0.2, 0.05)}, {"lane_offset": {"lat_alignment_m": 0.2}}),
    "lane_changing": ({"change_per_edge": 0.6}, {"lane_changing": {}}),
    "u_turns": ({"u_turn_share": 0.08}, {"u_turns": {}}),
    "parked_pull_out": ({"leaves_per_min": 6.0}, {"parked_pull_out": {"per_min": 6.0}}),
    "imperfection": ({"sigma": 0.9}, {"imperfection": {"sigma": 0.9}}),
    "reaction_time": ({"action_s": 0.8}, {"reaction_time": {"action_step_s": 0.8}}),
    "two_at_once": (
        {"speed": (1.2, 0.05), "offset": (0.2, 0.05)},
        {"speeding": {"speed_factor": 1.2}, "lane_offset": {"lat_alignment_m": 0.2}},
    ),
}


def main() -> None:
    """Run what is not done yet, then print a line a case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1, help="recordings of each habit")
    parser.add_argument("--nulls", type=int, default=5, help="recordings with nothing hidden")
    parser.add_argument("--cases", default="", help="regular expression of case names")
    parser.add_argument("--folder", type=Path, default=Path("out/hidden/traffic"))
    chosen = parser.parse_args()
    cases = [(f"{name}-{seed}", *hidden, seed) for name, hidden in _ONE.items() for seed in range(chosen.seeds)]
    cases += [(f"null-{seed}", {}, {}, 100 + seed) for seed in range(chosen.nulls)]
    for name, hidden, truth, seed in cases:
        if re.search(chosen.cases, name):
            _print(name, truth, _result(chosen.folder.resolve() / name, hidden, seed))


def _result(folder: Path, hidden: dict, seed: int) -> dict[str, Any]:
    path = folder / "found.json"
    if not path.exists():
        from cosim.capture.config import RunConfig
        from cosim.driver_discrepancy import traffic_diagnose

        folder.mkdir(parents=True, exist_ok=True)
        town, started = build_town(folder / "town", crossings=3), time.monotonic()
        task = {"config": str(town), "out": str(folder / "measured.csv"), "hidden": hidden, "seed": seed}
        (folder / "task.json").write_text(json.dumps({**task, "drivers": 44, "parked": 24, "seconds": 90}))
        maker = [sys.executable, "-m", "tests.hidden.traffic.maker", str(folder / "task.json")]
        subprocess.run(maker, check=True, cwd=_ROOT)
        config = RunConfig(town=str(town), behaviour=BEHAVIOUR)  # pyright: ignore[reportArgumentType]
        found = traffic_diagnose(folder / "measured.csv", config).to_json()
        path.write_text(json.dumps({**found, "total_s": time.monotonic() - started}, indent=1))
    return json.loads(path.read_text())


def _print(name: str, truth: dict[str, dict[str, float]], result: dict[str, Any]) -> None:
    names = [one["effect"] for one in result["effects"]]
    validated = "exact" if sorted(names) == sorted(truth) else "first" if names[:1] == list(truth)[:1] else "MISSED"
    report = []
    for one in result["effects"]:
        for key, true in truth.get(one["effect"], {}).items():
            low, high = one["ci95"][key]
            report.append(
                f"{key} {one['params'][key]:.3g} (true {true:g}, {'in' if low <= true <= high else 'OUT OF'} CI)"
            )
    fall = f"error {result['error_before']:.3f} → {result['error_after']:.3f} (floor {result['noise_floor']:.3f})"
    print(
        f"{name:20s} {validated:7s} {', '.join(names) or '–':30s} {fall} {'; '.join(report)} {result['total_s']:.0f} s"
    )


if __name__ == "__main__":
    main()
