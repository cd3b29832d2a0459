"""Two classes of drivers: a share of them wants to go another multiple of the limit."""

from __future__ import annotations

from collections.abc import Sequence

from cosim.driver_discrepancy.behaviours.base import Background, Behaviour, Knob, Signal, Values, changed_in
from cosim.traffic.behaviour import BehaviourConfig

_BEGINS_SHARE = 0.25
_BEGINS_RATIO = {True: 0.75, False: 1.3}


def _read(config: BehaviourConfig, _: Background) -> dict[str, float]:
    classes = config.driver_classes
    if classes is None:
        return {"share": 0.0, "speed_ratio": 1.0}
    return {"share": classes.share, "speed_ratio": classes.speed_ratio}


def _write(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    return changed_in(config, driver_classes={"share": values["share"], "speed_ratio": values["speed_ratio"]})


def _propose(config: BehaviourConfig, signals: Sequence[Signal]) -> BehaviourConfig | None:
    """A slow or a fast class, whichever the shares of slow and fast drivers suggest."""
    z = {signal.channel: signal.z for signal in signals if not signal.condition}
    slow, fast = z.get("slow_drivers", 0.0), z.get("fast_drivers", 0.0)
    if max(slow, fast) < 1.0:
        return None
    return changed_in(config, driver_classes={"share": _BEGINS_SHARE, "speed_ratio": _BEGINS_RATIO[slow > fast]})


DRIVER_CLASSES = Behaviour(
    "driver_classes",
    (
        Knob("share", "", 0.02, 0.6, 0.1, "probability that a driver belongs to the second class"),
        Knob("speed_ratio", "", 0.4, 1.9, 0.12, "desired speed of the second class over that of the first"),
    ),
    ("free_speed", "free_speed_spread", "slow_drivers", "fast_drivers"),
    "f = f₁ with 1 − share, ratio·f₁ with share",
    "vTypeDistribution of two vTypes",
    ("speeding",),
    _read,
    _write,
    propose=_propose,
)
