"""Recordings with hidden physics: scans only, calibrated blind, and the same drive with its true twin.

`python -m tests.hidden.recordings` simulates a drive of scans that follow each other, hides one effect after the other
in it, takes everything but `velodyne/` away, lets `cosim calibrate` and, on the drive with its twin, `cosim diagnose`
say what they find, and prints the table. Finished cases lie in `out/hidden/recordings/` and are not done again.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from sensors.pattern import load_pattern
from tests.hidden.amplitudes import parameters
from tests.hidden.drive import Hidden, make_drive

FOLDER = Path("out/hidden/recordings")
EFFECTS = (
    "sweep_motion", "elevation_offset", "range_walk", "incidence_falloff", "random_dropout", "ring_gain",
    "encoder_eccentricity", "incidence_bias", "dual_block", "range_falloff", "ring_elevation", "detection_threshold",
)  # fmt: skip
FURTHER = ("focal_response",)  # when named with --only
NULLS = 4
ORDERS = ("rings", "firings", "shuffled")
_EVERY_S = 0.1
_BASE = {
    "frames": 60,
    "frames_per_episode": 60,
    "collection": {"every_s": _EVERY_S, "min_travel_m": 0, "company_m": 1000},
    "images": [],
}
_TOWNS = ("town01", "town07")
_FIRINGS = {"hdl64e": 1042, "vlp32c": None}  # a turn; half of an HDL-64E's: as much to learn from, at half the cost
_PATH_M = 20.0  # of the car, at least
_SCANS = 24  # that the true twin is diagnosed on, evenly spread, as many as of a map


@dataclass(frozen=True)
class Case:
    """A recording to be calibrated.

    Attributes:
        name: the hidden effect, or `null` with a number.
        town: where.
        pattern: name of the beam pattern.
        effects: hidden, by name with parameters.
        seed: of noise and parameters.
    """

    name: str
    town: str
    pattern: str
    effects: Mapping[str, Mapping]
    seed: int


@dataclass(frozen=True)
class Answer:
    """What was said of one case.

    Attributes:
        found: effects with parameters and intervals, in order.
        shapes: channels of unknown shapes.
        unexplained: channels and covariates of what is left.
        is_recommended: whether the calibrated file is recommended; None of a diagnosis.
        cpu_s: user and system time.
    """

    found: list[dict[str, Any]]
    shapes: list[str]
    unexplained: list[str]
    is_recommended: bool | None
    cpu_s: float


def cases(seed: int) -> list[Case]:
    """Twelve effects and some further ones, strongly, and drives with nothing hidden; in two towns, with two patterns.

    Args:
        seed: of traffic, parameters and noise.
    """
    patterns = tuple(_FIRINGS)
    found = []
    for number, name in enumerate((*EFFECTS, *FURTHER)):
        pattern = patterns[number // 2 % 2]
        rings = len(load_pattern(pattern).elevation_deg)
        drawn = parameters(name, "strong", np.random.default_rng([seed, number]), rings)
        found.append(Case(name, _TOWNS[number % 2], pattern, {name: drawn}, 1000 * seed + number))
    for number in range(NULLS):
        null = Case(f"null{number}", _TOWNS[number % 2], patterns[number // 2 % 2], {}, 1000 * seed + 100 + number)
        found.append(null)
    return found


def base_drive(case: Case, folder: Path) -> Path:
    """Sixty scans, ten a second, of a moving car; simulated now if they are not there.

    The traffic seed is the first one, from the seed of all cases, with which the car moves far enough, without instants
    that are left out.
    """
    drive = folder / "base" / f"{case.town}_{case.pattern}"
    chosen = folder / "base" / f"{case.town}.seed"
    if not (drive / "drive.yaml").exists():
        drive.parent.mkdir(parents=True, exist_ok=True)
        settings = folder / "base.yaml"
        settings.write_text(yaml.safe_dump(_BASE))
        seed = int(chosen.read_text()) if chosen.exists() else case.seed // 1000
        own = ["--town", case.town, "--sensor", case.pattern, "--workers", "1", "--out", drive]
        _cosim("run", settings, *own, "--seed", seed)
        while path_length_m(drive) < _PATH_M or longest_pause_s(drive) > 1.5 * _EVERY_S:
            shutil.rmtree(drive)
            seed += 1
            _cosim("run", settings, *own, "--seed", seed)
        chosen.write_text(str(seed))
        _smooth_motion(drive)
    return drive


def _smooth_motion(drive: Path) -> None:
    """Replace the car's rates, which SUMO keeps for a step and then changes, by central differences of its poses.

    A sweep takes place before and after the pose time: with the rates of the step before, the car would jump between
    sweeps.
    """
    files = sorted((drive / "twin" / "frames").glob("*.json"))
    frames = _twin_frames(drive)
    poses = np.array([frame["ego"]["pose"] for frame in frames])
    time_s = np.array([frame["time_s"] for frame in frames])
    velocity = np.gradient(poses[:, :3, 3], time_s, axis=0)
    yaw_rate = np.gradient(np.unwrap(np.arctan2(poses[:, 1, 0], poses[:, 0, 0])), time_s)
    for file, frame, own, turning in zip(files, frames, velocity.tolist(), yaw_rate.tolist(), strict=True):
        frame["ego"] |= {"velocity_mps": own, "yaw_rate_radps": turning}
        file.write_text(json.dumps(frame))


def path_length_m(drive: Path) -> float:
    """Length of the path of the car of a simulated drive [m]."""
    places = np.array([frame["ego"]["pose"] for frame in _twin_frames(drive)])[:, :2, 3]
    return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())


def longest_pause_s(drive: Path) -> float:
    """Longest time between two successive frames of a simulated drive [s]."""
    return float(np.diff([frame["time_s"] for frame in _twin_frames(drive)]).max())


def _twin_frames(drive: Path) -> list[dict[str, Any]]:
    return [json.loads(file.read_text()) for file in sorted((drive / "twin" / "frames").glob("*.json"))]


def made(case: Case, folder: Path) -> tuple[Path, Path, Path]:
    """The recording, the drive with its true twin, and the sensor file that its user has."""
    path = folder / case.name
    drive = path / "drive"
    if not (path / "made").exists():
        shutil.rmtree(path, ignore_errors=True)
        path.mkdir(parents=True)
        hidden = Hidden(effects=case.effects, seed=case.seed, firings=_FIRINGS[case.pattern])
        make_drive(base_drive(case, folder), drive, hidden)
        (path / "recording").mkdir()
        shutil.copytree(drive / "velodyne", path / "recording" / "velodyne")
        (path / "made").touch()
    return path / "recording", drive, path / "drive.sensor.yaml"


def arranged(recording: Path, order: str) -> Path:
    """The recording with its points firing by firing, or shuffled, instead of ring by ring."""
    if order == "rings":
        return recording
    new = recording.with_name(f"recording_{order}")
    for file in sorted((recording / "velodyne").iterdir()):
        points = np.fromfile(file, "<f4").reshape(-1, 4)
        if order == "firings":
            rows = np.argsort(-np.arctan2(points[:, 1], points[:, 0]), kind="stable")
        else:
            rows = np.random.default_rng(int(file.stem)).permutation(len(points))
        (new / "velodyne").mkdir(parents=True, exist_ok=True)
        points[rows].tofile(new / "velodyne" / file.name)
    return new


def calibrated(case: Case, folder: Path, sensor: bool, rounds: int, order: str = "rings") -> Answer:
    """Result from scans only, starting from the user's sensor file or from nothing; findings from points come first."""
    recording, _, file = made(case, folder)
    recording = arranged(recording, order)
    name = "calibrated_from_file" if sensor else "calibrated"
    out = folder / case.name / (name if order == "rings" else f"{name}_{order}")
    own = ["--sensor", file] if sensor else []
    report, cpu_s = _pattern_findings(out, "calibrate", recording, *own, "--rounds", rounds, "--out", out / "files")
    number = report["acceptance"]["round"] or len(report["rounds"])
    found = {one["effect"]: one for one in [*_of_points(report["rounds"][0]["effects"]), *report["effects"]]}
    return _answer(list(found.values()), report["rounds"][number - 1], report["recommended"], cpu_s)


def _of_points(effects: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Findings of the pattern estimate before any diagnosis: two optical centres; noise is an initial value."""
    return [
        {"effect": one["effect"], "params": {name: one[name] for name in one if name != "effect"}, "ci95": {}}
        for one in effects
        if "noise" not in one["effect"]
    ]


def diagnosed(case: Case, folder: Path) -> Answer:
    """What the same points say with the true twin."""
    _, drive, file = made(case, folder)
    out = folder / case.name / "diagnosed"
    report, cpu_s = _pattern_findings(
        out, "diagnose", drive, "--sensor", file, "--frames", _SCANS, "--out", out / "files"
    )
    return _answer(report["effects"], report, None, cpu_s)


def _answer(
    effects: list[dict[str, Any]], values: Mapping[str, Any], is_recommended: bool | None, cpu_s: float
) -> Answer:
    shapes = [f"{one['channel']} by {'+'.join(one['covariates'])}" for one in values["unknowns"]]
    left = [f"{one['channel']} by {'+'.join(one['covariates'])}" for one in values["unexplained"]]
    return Answer(effects, shapes, left, is_recommended, cpu_s)


def _pattern_findings(out: Path, *command: object) -> tuple[dict[str, Any], float]:
    """The JSON of a command, run now if it has not been, and its CPU seconds."""
    file, cost = out / "told.json", out / "cpu_s.json"
    if not cost.exists():
        out.mkdir(parents=True, exist_ok=True)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        _cosim(*command, "--json", file)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cost.write_text(json.dumps(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime))
    return json.loads(file.read_text()), json.loads(cost.read_text())


def _cosim(*words: object) -> None:
    command = [sys.executable, "-c", "import sys; from cosim.cli import main; sys.exit(main())", *map(str, words)]
    one_thread = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run([*command, "--quiet"], check=True, env=one_thread)


def line(case: Case, answer: Answer) -> str:
    """A row of the table."""
    names = [one["effect"] for one in answer.found]
    right = names[:1] == list(case.effects)[:1]
    drive = f"{case.name:22s} {case.town} {case.pattern}"
    words = [drive, "right" if right else "WRONG", f"{answer.cpu_s:6.0f} s", ", ".join(names) or "nothing"]
    if answer.is_recommended is not None:
        words.append("recommended" if answer.is_recommended else "not recommended")
    for one in answer.found:
        if one["effect"] in case.effects:
            words.append(_compared(case.effects[one["effect"]], one))
    return "  ".join([*words, f"shapes {answer.shapes}" if answer.shapes else "", f"left {len(answer.unexplained)}"])


def _compared(true: Mapping[str, Any], result: Mapping[str, Any]) -> str:
    message = []
    for name, value in true.items():
        report = result["params"].get(name)
        if isinstance(value, list):
            away = np.subtract(report, value)
            message.append(f"{name} sd of error {np.std(away):.3g} of {np.std(value):.3g}")
        elif isinstance(value, float | int) and report is not None:
            interval = result["ci95"].get(name) or ["", ""]
            message.append(f"{name} {report:.4g} {interval} true {value:.4g}")
    return "; ".join(message)


def main(words: list[str] | None = None) -> None:
    """Make, calibrate, diagnose, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=FOLDER)
    parser.add_argument("--seed", type=int, default=7, help="of traffic, parameters and noise; a folder holds one seed")
    parser.add_argument("--only", nargs="*", default=[], help="names of cases")
    parser.add_argument("--from-file", action="store_true", help="start from the user's sensor file, not from nothing")
    parser.add_argument("--true-twin", action="store_true", help="also diagnose with the true twin")
    parser.add_argument("--order", choices=ORDERS, default="rings", help="of the points in the files")
    parser.add_argument("--rounds", type=int, default=5, help="of map and diagnosis at most")
    options = parser.parse_args(words)
    every = {case.name: case for case in cases(options.seed)}
    for case in (every[name] for name in options.only or every if name in options.only or name not in FURTHER):
        answer = calibrated(case, options.folder, options.from_file, options.rounds, options.order)
        print("scans only:", line(case, answer), flush=True)
        if options.true_twin:
            print("true twin:  ", line(case, diagnosed(case, options.folder)), flush=True)
        name = case.name if options.order == "rings" else f"{case.name}_{options.order}"
        (options.folder / f"{name}.json").write_text(json.dumps(asdict(answer)))


if __name__ == "__main__":
    main()
