"""What every kind of unseen effect is made of: a draw, a stage, an action and the correct findings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tests.hidden.columns import kind, made_of
from tests.hidden.head import Aim, Beams
from tests.hidden.scan import Scan, bare_scan
from tests.hidden.truth import Finding
from tests.hidden.twin_tracing import Twin

Parameters = Mapping[str, Any]
LEVELS = ("quarter", "half", "one", "strong")
STAGES = ("twin", "aim", "signal", "detected", "spread", "range", "clutter", "reported", "law")
TIME, AZIMUTH, RINGS = ("frame_time", "time", "scan"), ("azimuth", "firing_time"), ("ring", "elevation", "block")
SIGNAL = ("intensity", "albedo", "material")
_FACTORS = {"quarter": 0.25, "half": 0.5, "one": 1.0}
_STRONG, _VARIATION = (2.5, 4.0), (0.85, 1.15)
# One standard deviation of the point noise: 2 cm, 10 %; angles that move a typical return by about as much. Shares of
# beams have no such scale: these are plain but not striking.
_ONE = {
    "range_m": 0.02,
    "intensity": 0.10,
    "elevation_deg": 0.02,
    "azimuth_deg": 0.10,
    "loss": 0.06,
    "echo": 0.01,
    "spread": 0.5,
}
_SCANS = 4  # of a drive that parameters are chosen by


class NotApplicableError(Exception):
    """The drive has nothing that the effect could act on."""


@dataclass(frozen=True, eq=False)
class World:
    """What a drive offers to an unseen effect.

    Attributes:
        frames: JSON of all frames.
        beams: nominal beams.
        scans: bare scans of some frames.
    """

    frames: Sequence[Mapping[str, Any]]
    beams: Beams
    scans: tuple[Scan, ...]

    @classmethod
    def of(cls, twin: Twin, frames: Sequence[Mapping[str, Any]], beams: Beams) -> World:
        """Trace some frames of a drive."""
        rows = sorted({round(row) for row in np.linspace(0, len(frames) - 1, _SCANS)})
        scans = tuple(bare_scan(twin, dict(frames[row]), beams, Aim.nominal(beams)) for row in rows)
        return cls(frames, beams, scans)

    def share(self, mask: Callable[[Scan], np.ndarray]) -> float:
        """Share of all beams that return something and are in a mask."""
        return float(np.mean([(mask(scan) & scan.found).mean() for scan in self.scans]))

    def values(self, of: Callable[[Scan], np.ndarray]) -> np.ndarray:
        """Values of all beams that return something."""
        return np.concatenate([of(scan)[scan.found] for scan in self.scans])

    def materials(self, low: float, high: float) -> list[str]:
        """Materials that a share of beams between two limits meets, without porous ones."""
        names = [name for name in self.scans[0].table.names if not name.startswith(("hedge", "foliage", "grass"))]
        return [name for name in names if low <= self.share(lambda scan, n=name: made_of(scan, (n,))) <= high]

    def kinds(self, fewest_objects: int, fewest_beams: int) -> list[str]:
        """Kinds of road users that enough objects and beams belong to."""
        found = []
        for name in sorted({thing["kind"] for frame in self.frames for thing in frame["instances"]}):
            beams, objects = 0, set()
            for scan in self.scans:
                rows = scan.instance[(kind(scan) == name) & scan.found]
                beams += len(rows)
                objects |= {scan.frame["instances"][row]["id"] for row in np.unique(rows)}
            if len(objects) >= fewest_objects and beams / len(self.scans) >= fewest_beams:
                found.append(name)
        return found

    @property
    def duration_s(self) -> float:
        """From the first to the last pose time."""
        return float(self.frames[-1]["time_s"] - self.frames[0]["time_s"])

    @cached_property
    def heading_range_deg(self) -> float:
        """Smallest sector that holds all headings of the ego."""
        poses = np.array([frame["ego"]["pose"] for frame in self.frames], float)
        heading = np.sort(np.degrees(np.arctan2(poses[:, 1, 0], poses[:, 0, 0])))
        gaps = np.append(np.diff(heading), heading[0] + 360 - heading[-1])
        return float(360 - gaps.max())


Draw = Callable[[np.random.Generator, str, World], dict[str, Any]]


@dataclass(frozen=True)
class Kind:
    """A kind of unseen effect.

    Attributes:
        draw: generator, level, world → parameters that JSON can hold.
        truths: parameters, world → the correct findings, one per effect.
        stage: parameters → one of `STAGES`, the step of the measurement at which it acts.
        act: the action. `twin`: frames, parameters. `aim`: aim, beams, frame, distances (n,), generator, parameters.
            `spread`: scan, channel, parameters → factors (n,). Others: scan, generator, parameters.
        is_random: parameters → whether the action draws random numbers.
    """

    draw: Draw
    truths: Callable[[Parameters, World], tuple[Finding, ...]]
    stage: Callable[[Parameters], str]
    act: Callable[..., Any]
    is_random: Callable[[Parameters], bool] = lambda p: False


def amplitude(rng: np.random.Generator, level: str, quantity: str, signed: bool = False) -> float:
    """Draw a size: a share of one standard deviation of the point noise, or plain to see."""
    factor = rng.uniform(*_STRONG) if level == "strong" else _FACTORS[level] * rng.uniform(*_VARIATION)
    sign = rng.choice([-1, 1]) if signed else 1
    return round(float(sign * factor * _ONE[quantity]), 6)


def pick(rng: np.random.Generator, choices: Sequence[Any]) -> Any:
    """Draw one of several; raise NotApplicableError where there is none."""
    if not len(choices):
        raise NotApplicableError
    return choices[int(rng.integers(len(choices)))]


def uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number with four digits."""
    return round(float(rng.uniform(low, high)), 4)


def bell(x: np.ndarray, centre: float, width: float, period: float = 0.0) -> np.ndarray:
    """exp(−(x − centre)²/width²), on a circle where there is a period."""
    away = x - centre
    if period:
        away = np.mod(away + period / 2, period) - period / 2
    return np.exp(-((away / width) ** 2))


def curve(covariate: str, unit: str, x: np.ndarray, y: np.ndarray) -> dict[str, Any]:
    """A true shape as a table."""
    return {"covariate": covariate, "unit": unit, "x": np.round(x, 6).tolist(), "y": np.round(y, 8).tolist()}
