"""Writes a measured drive with hidden physics, and the truth next to it.

`python -m tests.hidden.drive BASE OUT --effect 'range_walk: {amplitude_m: 0.05, decay: 4}'` makes `OUT/` (the
drive), `OUT.sensor.yaml` (the user's model) and `OUT.truth.json` (the hidden truth).
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import yaml

from tests.hidden.glb_edit import rename_materials
from tests.hidden.head import nominal_beams
from tests.hidden.nuisances import warp_map, written_frames
from tests.hidden.physics import CATALOGUE, Truth, measure
from tests.hidden.tall_things import move_tall_things
from tests.hidden.truth import Finding
from tests.hidden.twin_files import MaterialTable, read_frames, read_pattern
from tests.hidden.twin_tracing import Twin
from tests.hidden.unseen.kind import World
from tests.hidden.unseen.registry import KINDS

BASE_NOISE: dict[str, dict] = {"range_noise": {"sigma_m": 0.02}, "intensity_noise": {"sigma_rel": 0.1}}


@dataclass(frozen=True)
class Made:
    """Where a made drive lies.

    Attributes:
        drive: the folder.
        sensor: the user's sensor file.
        truth: JSON of what was hidden.
    """

    drive: Path
    sensor: Path
    truth: Path


@dataclass(frozen=True)
class Hidden:
    """What to hide.

    Attributes:
        effects: hidden catalogue effects and parameters; one the user knows, too, is the true one.
        unseen: hidden kinds of `unseen.registry.KINDS` and their parameters.
        known: effects that are true and that the user's file has.
        nuisances: of `nuisances.NUISANCES`, and `outliers`, `heavy_tails`.
        noise: false for a drive without any noise.
        range_law, intensity_law: see `reading.LAWS`.
        frames: how many of the base drive's, at most.
        firings: of a reduced pattern; None for all.
        every_ring: keep one ring in so many.
        rays: write `rays/`.
        foreign: the twin's materials have names that no simulator knows.
        seed: of everything random.
    """

    effects: Mapping[str, Mapping] = field(default_factory=dict)
    unseen: Mapping[str, Mapping] = field(default_factory=dict)
    known: Mapping[str, Mapping] = field(default_factory=dict)
    nuisances: tuple[str, ...] = ()
    noise: bool = True
    range_law: str = "gaussian"
    intensity_law: str = "gaussian"
    frames: int | None = None
    firings: int | None = None
    every_ring: int = 1
    rays: bool = True
    foreign: bool = False
    seed: int = 0

    @property
    def believed(self) -> dict[str, Mapping]:
        """What the user's sensor file has."""
        return {**self.known, **(BASE_NOISE if self.noise else {})}

    @property
    def truth(self) -> Truth:
        """The true sensor."""
        return Truth(
            effects={**self.believed, **self.effects},
            unseen=self.unseen,
            range_law="student3" if "heavy_tails" in self.nuisances else self.range_law,
            intensity_law=self.intensity_law,
            outliers=0.01 if "outliers" in self.nuisances else 0.0,
        )


def make_drive(base: Path, out: Path, hidden: Hidden) -> Made:
    """Write a measured drive.

    Args:
        base: a drive of `cosim run`; only its twin, pattern and calibration are used.
        out: folder to write; what is there is removed.
        hidden: what to hide.
    """
    base, out = Path(base), Path(out)
    frames, pattern = read_frames(base, hidden.frames), reduced(read_pattern(base), hidden)
    shutil.rmtree(out, ignore_errors=True)
    for folder in ("velodyne", "rays", "calib", "twin/frames"):
        (out / folder).mkdir(parents=True)
    _write_scans(base, out, frames, pattern, hidden)
    _write_twin(base, out, frames, hidden)
    made = Made(out, out.with_name(out.name + ".sensor.yaml"), out.with_name(out.name + ".truth.json"))
    _write_papers(made, base, pattern, frames, hidden)
    return made


def reduced(pattern: dict, hidden: Hidden) -> dict:
    """The pattern with fewer firings and rings, still by the rule of pattern files."""
    if hidden.firings is None and hidden.every_ring == 1:
        return pattern
    every = slice(None, None, hidden.every_ring)
    rings = {key: pattern[key][every] for key in ("elevation_deg", "azimuth_offset_deg", "block") if key in pattern}
    return {**pattern, **rings, "firings": hidden.firings or pattern["firings"], "name": f"{pattern['name']}_reduced"}


def frame_generator(hidden: Hidden, row: int) -> np.random.Generator:
    """The randomness of one frame."""
    return np.random.default_rng([hidden.seed, 7, row])


def _write_scans(base: Path, out: Path, frames: list[dict], pattern: dict, hidden: Hidden) -> None:
    twin, truth, beams = Twin(base / "twin"), hidden.truth, nominal_beams(pattern)
    for row, frame in enumerate(frames):
        elapsed = frame["time_s"] - frames[0]["time_s"]
        columns = measure(truth, twin, frame, beams, frame_generator(hidden, row), elapsed).points()
        columns.pop("points").tofile(out / "velodyne" / f"{frame['frame']}.bin")
        if hidden.rays:
            np.savez(out / "rays" / f"{frame['frame']}.npz", **columns)  # pyright: ignore[reportArgumentType]
        shutil.copyfile(base / "calib" / f"{frame['frame']}.txt", out / "calib" / f"{frame['frame']}.txt")


def correct_findings(base: Path, hidden: Hidden) -> list[Finding]:
    """What a diagnosis should report of the unseen effects of a drive."""
    if not hidden.unseen:
        return []
    world = world_of(base, hidden)
    return [truth for name, p in hidden.unseen.items() for truth in KINDS[name].truths(p, world)]


def world_of(base: Path, hidden: Hidden) -> World:
    """What a base drive offers to unseen effects."""
    frames, beams = read_frames(base, hidden.frames), nominal_beams(reduced(read_pattern(base), hidden))
    return World.of(Twin(base / "twin"), frames, beams)


def _write_twin(base: Path, out: Path, frames: list[dict], hidden: Hidden) -> None:
    rng = np.random.default_rng([hidden.seed, 8])
    written = written_frames(frames, hidden.nuisances, rng)
    for name, p in hidden.truth.at("twin"):
        KINDS[name].act(written, p)
    for frame in written:
        path = out / "twin" / "frames" / f"{frame['frame']}.json"
        path.write_text(json.dumps(frame))
    names = {name: f"MAT.{row:03d}" for row, name in enumerate(MaterialTable(base / "twin" / "materials.yaml").names)}
    for path in sorted((base / "twin").rglob("*.*")):
        target = out / "twin" / path.relative_to(base / "twin")
        if path.parent.name == "frames":
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        if hidden.foreign and path.suffix == ".glb":
            rename_materials(path, target, names)
        elif hidden.foreign and path.name == "materials.yaml":
            table = yaml.safe_load(path.read_text())
            target.write_text(yaml.safe_dump({names[name]: entry for name, entry in table.items()}))
        elif "map_error" in hidden.nuisances and _is_map(path):
            warp_map(path, target, rng)
        elif "harder" in hidden.nuisances and _is_map(path):
            move_tall_things(path, target, rng)
        else:
            _link(path, target)


def _is_map(path: Path) -> bool:
    return path.suffix == ".glb" and path.parent.name != "models"


def _write_papers(made: Made, base: Path, pattern: dict, frames: list[dict], hidden: Hidden) -> None:
    (made.drive / "pattern.yaml").write_text(yaml.safe_dump(pattern, sort_keys=False))
    document = {"kind": "measured", "pattern": pattern["name"], "sweep_s": pattern["sweep_s"]}
    (made.drive / "drive.yaml").write_text(yaml.safe_dump(document))
    if not hidden.rays:
        (made.drive / "rays").rmdir()
    named = pattern["name"]
    if named.endswith("_reduced"):
        named = f"./{made.drive.name}/pattern.yaml"
    effects = [{"effect": name, **dict(parameters)} for name, parameters in hidden.believed.items()]
    made.sensor.write_text(yaml.safe_dump({"pattern": named, "effects": effects}, sort_keys=False))
    findings = [truth.to_json() for truth in correct_findings(base, hidden)]
    secret = {"base": str(base), "frames": len(frames), **asdict(hidden), "findings": findings}
    made.truth.write_text(json.dumps(secret, indent=1, default=list))


def _link(source: Path, target: Path) -> None:
    try:
        os.link(source, target)
    except OSError:  # another file system
        shutil.copyfile(source, target)


def main() -> None:
    """Make one drive from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("base", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--effect", action="append", default=[], help="YAML: 'name: {parameter: value}'")
    parser.add_argument("--known", action="append", default=[], help="as --effect; the user's file has it, too")
    parser.add_argument("--nuisance", action="append", default=[])
    parser.add_argument("--frames", type=int)
    parser.add_argument("--firings", type=int)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    given = {key: value for text in chosen.effect for key, value in yaml.safe_load(text).items()}
    hidden = Hidden(
        effects={name: value for name, value in given.items() if name in CATALOGUE},
        unseen={name: value for name, value in given.items() if name in KINDS},
        known={key: value for text in chosen.known for key, value in yaml.safe_load(text).items()},
        nuisances=tuple(chosen.nuisance),
        frames=chosen.frames,
        firings=chosen.firings,
        seed=chosen.seed,
    )
    if strange := set(given) - set(CATALOGUE) - set(KINDS):
        parser.error(f"no maker for {', '.join(sorted(strange))}")
    made = make_drive(chosen.base, chosen.out, hidden)
    print(made.drive, made.sensor, made.truth, sep="\n")


if __name__ == "__main__":
    main()
