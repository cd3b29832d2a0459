"""Changes of a scan and of its labels by a single effect."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from sensors.effects.registry import built_in_effects
from sensors.hits import NOTHING
from sensors.label_boxes import LabelBoxes
from sensors.motion import EgoMotion
from sensors.returns import Returns
from sensors.sensor_model import points_of
from tests.sensors.effects.scenes import LIDAR, cars, effect, room, sensor, shoot, street

EGO = EgoMotion(np.eye(4), np.array([10.0, 2.0, 0.0]), 0.3, np.array([2.0, 0.0, 0.0]))
_SHOWS_AS = {"pose": "range", "range_variance": "range", "intensity_variance": "intensity"}
_RANGE_STEP_M, _INTENSITY_STEP = 1e-4, 1e-6


@dataclass(frozen=True)
class Change:
    """A scan after an effect against the same scan before it.

    Attributes:
        name: of the effect.
        scene: in which it was seen.
        shares: by channel, of the beams that answered before: those whose range or intensity is another, which are
            lost or won (`drop`), and returns that no surface gave (`spurious`); of the boxes, those changed (`label`).
        range_m, intensity: median size of the change where there is one; 0 where there is none.
    """

    name: str
    scene: str
    shares: dict[str, float]
    range_m: float
    intensity: float

    @property
    def channels(self) -> set[str]:
        """What changed at all."""
        return {channel for channel, share in self.shares.items() if share}

    @property
    def own(self) -> str:
        """The channel that the effect is about, as it shows in one scan."""
        return _SHOWS_AS.get(built_in_effects()[self.name].channel, built_in_effects()[self.name].channel)

    @property
    def allowed(self) -> set[str]:
        """Its own channel, and those that it says it cannot but touch."""
        return {self.own, *(_SHOWS_AS.get(channel, channel) for channel in built_in_effects()[self.name].also)}

    @property
    def holds(self) -> bool:
        """Whether its own channel changed, and none that it does not name."""
        return self.own in self.channels <= self.allowed


def change_by(name: str) -> Change:
    """What the effect changes with its example's parameters."""
    kind = built_in_effects()[name]
    # Deflected beams hit other objects: only in a uniform scene does a deflection change just the range.
    where = "room" if kind.stage == "beam" else "street"
    before, _ = bare(where)
    after, shot = _shot(where, effect(name))
    shares, range_m, intensity = _compared(before, after)
    if kind.stage == "label":
        old, new = boxes(after, shot), sensor(effect(name)).relabel(boxes(after, shot))
        same = (
            np.isclose(old.centre, new.centre).all(1) & np.isclose(old.size, new.size).all(1) & (old.kept == new.kept)
        )
        shares["label"] = float((~same).mean())
    return Change(name, where, shares, range_m, intensity)


@lru_cache(maxsize=2)
def bare(where: str):
    """Returns and shot without any effect."""
    return _shot(where)


def _shot(where: str, *effects):
    if where == "room":
        return shoot(sensor(*effects), room(), ego=EGO)
    return shoot(sensor(*effects), street(), placed=cars(), ego=EGO)


def boxes(returns: Returns, shot) -> LabelBoxes:
    """The street's cars as labels; the second is in the sky, where there are no points."""
    placed = cars()
    return LabelBoxes(
        kinds=("Car",) * len(placed),
        centre=(np.linalg.inv(LIDAR) @ placed.poses)[:, :3, 3] + [[0, 0, 0.75], [0, 0, 30]],
        size=np.tile([4.0, 1.7, 1.5], (len(placed), 1)),
        yaw=np.arctan2(placed.poses[:, 1, 0], placed.poses[:, 0, 0]),
        kept=np.ones(len(placed), bool),
        points=points_of(returns, shot).xyz,
    )


def _compared(before: Returns, after: Returns) -> tuple[dict[str, float], float, float]:
    count = len(before)
    _, old, new = np.intersect1d(before.beam, after.beam, return_indices=True)
    stands = after.instance[new] != NOTHING
    old, new = old[stands], new[stands]
    further = np.abs(after.range_m[new] - before.range_m[old])
    brighter = np.abs(after.intensity[new] - before.intensity[old])
    moved, dimmed = further > _RANGE_STEP_M, brighter > _INTENSITY_STEP
    # Whether a beam returns: also where its footprint now reaches a surface that its middle misses.
    lost = ~np.isin(before.beam, after.beam)
    won = ~np.isin(np.unique(after.beam[after.instance != NOTHING]), before.beam)
    shares = {
        "range": moved.sum() / count,
        "intensity": dimmed.sum() / count,
        "drop": (lost.sum() + won.sum()) / count,
        "spurious": (after.instance == NOTHING).sum() / count,
        "label": 0.0,
    }
    return (
        {channel: float(share) for channel, share in shares.items()},
        _median(further[moved]),
        _median(brighter[dimmed]),
    )


def _median(values: np.ndarray) -> float:
    return float(np.median(values)) if len(values) else 0.0
