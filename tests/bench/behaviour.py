"""What happens in the towns, and how plausibly vehicles move there: `python -m tests.bench.behaviour`."""

from __future__ import annotations

import argparse
import dataclasses
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import yaml
from rich.console import Console
from rich.table import Table

from cosim.traffic.behaviour import BehaviourConfig, Event
from cosim.traffic.driven_traffic import DrivenTraffic
from cosim.traffic.ego import draw_ego
from cosim.traffic.simulation import Traffic
from sumo_nets import TOWNS, read_town
from tests.cosim.inspector import Inspector, Touch

_SETTLES_STEPS = 5  # parked vehicles take their places
_PEOPLE = ("pedestrian", "cyclist")
_EGO_FROM_S = 60.0  # as in a drive
_KINDS = ("u_turn", "pull_out", "pull_in", "lane_change", "collision", "contact", "taken_away")


@dataclass(frozen=True)
class Stay:
    """Some minutes in a town.

    Attributes:
        town: its name.
        about, driving, parked, people: road users at once, on average over the second half.
        events: kind → number.
        teleports: of SUMO.
        steps: vehicle-steps of those not parked.
        sideways_m, turn_deg: the largest in a step.
        speed_error, speed_error_tail: largest, and exceeded by one in a thousand.
        surprises: who appeared or vanished in the ego vehicle's sight.
        unrecorded: overlaps of boxes outside recorded collisions; contacts are none.
    """

    town: str
    about: float
    driving: float
    parked: float
    people: float
    events: dict[str, int]
    teleports: int
    steps: int
    sideways_m: float
    turn_deg: float
    speed_error: float
    speed_error_tail: float
    surprises: list[tuple[float, str]]
    unrecorded: list[Touch]
    touches: list[Touch]


def stay(town: str, config: BehaviourConfig, seconds: float, seed: int, tolerance_m: float = 0.0) -> Stay:
    """Simulate and watch a town; one SUMO simulation runs in this process meanwhile."""
    inspector, teleports, counts = Inspector(tolerance_m=tolerance_m), 0, []
    files = read_town(town)
    with Traffic(files.sumocfg, seed=seed) as traffic:
        living = DrivenTraffic(traffic, config, seed=seed, beside_parked=0.05)
        steps, ego, rng = round(seconds / traffic.step_s), "", np.random.default_rng(seed)
        for number in range(steps):
            actors = living.step()
            if not ego and actors.time_s > _EGO_FROM_S:
                ego = draw_ego(traffic, actors, rng)
                living.protect(ego)
            if ego in actors.ids and number % 10 == 0:
                traffic.prolong_route(ego, rng)
            teleports += traffic.api.simulation.getStartingTeleportNumber()
            if number >= _SETTLES_STEPS:
                inspector.look(actors, ego)
            if number >= steps // 2 and number % 50 == 0:
                people = sum(kind in _PEOPLE for kind in actors.kinds)
                counts.append((len(actors), int(actors.parked.sum()), people))
        events = list(living.events)
    about, parked, people = np.mean(np.array(counts).reshape(-1, 3), axis=0).tolist() if counts else (0.0, 0.0, 0.0)
    errors = inspector.speed_error
    return Stay(
        town=town,
        about=about,
        driving=about - parked - people,
        parked=parked,
        people=people,
        events=dict(Counter(event.kind for event in events)),
        teleports=teleports,
        steps=inspector.steps,
        sideways_m=inspector.sideways_m,
        turn_deg=inspector.turn_deg,
        speed_error=float(errors.max()),
        speed_error_tail=float(np.quantile(errors, 0.999)),
        surprises=inspector.surprises,
        unrecorded=unrecorded(inspector.touches, events),
        touches=inspector.touches,
    )


def unrecorded(touches: list[Touch], events: list[Event]) -> list[Touch]:
    """Overlaps of two vehicles that did not collide as drawn."""
    recorded = {tuple(sorted(event.vehicles)) for event in events if event.kind == "collision"}
    return [touch for touch in touches if touch.vehicles not in recorded]


def table(stays: list[Stay], title: str) -> Table:
    """One row a town."""
    result = Table(title=title)
    result.add_column("town")
    columns = ("about", "driving", "parked", "people", "U-turns", "pull-outs", "pull-ins", "lane changes")
    columns += ("collisions", "contacts", "taken away", "surprises", "teleports", "sideways [m]", "turn [deg]")
    columns += ("speed error p99.9", "max", "overlaps unrecorded", "vehicle-steps")
    for column in columns:
        result.add_column(column, justify="right")
    for one in stays:
        total = max(one.about, 1.0)
        shares = [f"{part / total:.0%}" for part in (one.driving, one.parked, one.people)]
        happened = [str(one.events.get(kind, 0)) for kind in _KINDS]
        motion = [str(len(one.surprises)), str(one.teleports), f"{one.sideways_m:.3f}", f"{one.turn_deg:.2f}"]
        motion += [f"{one.speed_error_tail:.2%}", f"{one.speed_error:.2%}", str(len(one.unrecorded)), str(one.steps)]
        result.add_row(one.town, f"{one.about:.0f}", *shares, *happened, *motion)
    return result


def _in_own_process(town: str, args: argparse.Namespace) -> Stay:
    """One process runs one SUMO simulation."""
    command = [sys.executable, "-m", "tests.bench.behaviour", town, "--raw", "--minutes", str(args.minutes)]
    command += ["--seed", str(args.seed), "--behaviour", args.behaviour]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{town}: {done.stderr}")
    values = yaml.safe_load(done.stdout)
    for name in ("unrecorded", "touches"):
        values[name] = [Touch(**{**touch, "vehicles": tuple(touch["vehicles"])}) for touch in values[name]]
    return Stay(**values)


def main() -> None:
    """Print one row a town, and with `--contacts` every overlap of boxes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("towns", nargs="*", default=list(TOWNS))
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--behaviour", default="paper", help="a preset, or YAML: '{preset: paper, u_turns_per_min: 0}'")
    parser.add_argument("--workers", type=int, default=1, help="towns at the same time")
    parser.add_argument("--contacts", action="store_true", help="print every overlap of boxes, the deepest first")
    parser.add_argument("--raw", action="store_true", help="print the first town's values as YAML")
    args = parser.parse_args()
    if args.raw:
        config = BehaviourConfig.model_validate(yaml.safe_load(args.behaviour))
        one = stay(args.towns[0], config, args.minutes * 60, args.seed)
        print(yaml.safe_dump(_plain(dataclasses.asdict(one))))
        return
    console = Console(width=240)
    with ThreadPoolExecutor(args.workers) as pool:
        stays = list(pool.map(lambda town: _in_own_process(town, args), args.towns))
    console.print(table(stays, f"{args.minutes:g} simulated minutes, behaviour {args.behaviour}, seed {args.seed}"))
    if args.contacts:
        for one in stays:
            pairs = {touch.vehicles for touch in one.unrecorded}
            for touch in sorted(one.touches, key=lambda touch: -touch.depth_m):
                known = "unrecorded" if touch.vehicles in pairs else "recorded"
                lasts = touch.end_s - touch.begin_s
                print(f"{one.town} {touch.begin_s:.1f} s, {lasts:.1f} s, {touch.depth_m:.3f} m, {known}: {touch.scene}")


def _plain(values: object) -> object:
    """Tuples as lists, numbers as Python's own."""
    if isinstance(values, dict):
        return {key: _plain(value) for key, value in values.items()}
    if isinstance(values, list | tuple):
        return [_plain(value) for value in values]
    return values.item() if isinstance(values, np.generic) else values


if __name__ == "__main__":
    main()
