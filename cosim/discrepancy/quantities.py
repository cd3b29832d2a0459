"""Names of channels, covariates and hypotheses as people read them, with units for display."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np


def dependence_words(channel: str, covariates: Iterable[str]) -> str:
    """A hypothesis of the dictionary: `range by incidence and range`, `range error shared by each firing`."""
    names = tuple(covariates)
    if channel.startswith("shared_"):
        return f"{channel_words(channel)} shared by each {unit_words(names[0])}"
    if names == ("constant",):
        return f"{channel_words(channel)}, the same for all beams"
    return f"{channel_words(channel)} by {' and '.join(covariate_words(name) for name in names)}"


def group_words(name: str) -> str:
    """The name of a hypothesis in words: `range_walk` of `range_walk [amplitude_m; decay 4]`, `range by albedo`."""
    channel, _, on = name.partition(" [")[0].partition(" by ")
    if not on:
        return channel if channel not in CHANNELS else f"{channel_words(channel)}, the same for all beams"
    if channel.startswith("shared_"):
        return dependence_words(channel, (on,))
    return f"{channel_words(channel)} by {' and '.join(covariate_words(part) for part in on.split(' x '))}"


def channel_words(channel: str) -> str:
    """A channel of `diagnose --json` in words."""
    return CHANNELS.get(channel, channel.replace("_", " "))


CHANNELS = {
    "range": "range",
    "azimuth_error": "azimuth error",
    "elevation_error": "elevation error",
    "intensity": "intensity",
    "intensity_offset": "intensity offset",
    "drop": "probability of a return",
    "spurious": "share of spurious returns",
    "early": "share of early returns",
    "late": "share of late returns",
    "range_variance": "range noise",
    "intensity_variance": "intensity noise",
    "shared_range": "range error",
    "shared_azimuth_error": "azimuth error",
    "shared_elevation_error": "elevation error",
    "shared_intensity": "intensity error",
    "shared_drop": "loss",
    "wiring": "exchanged lasers",
}


def unit_words(unit: str) -> str:
    """The unit of beams that share an error."""
    return _UNITS.get(unit, unit)


_UNITS = {
    "packet": "packet of firings", "sector": "sector of a turn", "ring": "ring in a scan",
    "block": "block of lasers in a scan",
}  # fmt: skip


def covariate_words(name: str) -> str:
    """A covariate of `diagnose --json` in words."""
    return shown(name).words.split(",")[0]


@dataclass(frozen=True)
class QuantityStyle:
    """A covariate for display: words, and the unit into which values are converted by a factor."""

    words: str
    unit: str = ""
    factor: float = 1.0


_DEGREES = 180 / np.pi
SHOWN = {
    "constant": QuantityStyle("all beams"),
    "range": QuantityStyle("predicted range", "m"),
    "incidence": QuantityStyle("angle of incidence", "°"),
    "ring": QuantityStyle("ring, 0 on top"),
    "azimuth": QuantityStyle("azimuth, left is positive", "°", _DEGREES),
    "intensity": QuantityStyle("predicted intensity"),
    "firing_time": QuantityStyle("firing time from the pose time", "ms", 1000.0),
    "material": QuantityStyle("material"),
    "kind": QuantityStyle("class of the object"),
    "model": QuantityStyle("model of the object"),
    "albedo": QuantityStyle("reflectance of the surface"),
    "elevation": QuantityStyle("elevation of the beam", "°"),
    "block": QuantityStyle("block of lasers"),
    "frame_time": QuantityStyle("time of the frame", "s"),
    "time": QuantityStyle("time", "s"),
    "scan": QuantityStyle("scan, in order of time"),
    "speed": QuantityStyle("speed of the vehicle", "m/s"),
    "acceleration": QuantityStyle("acceleration of the vehicle", "m/s²"),
    "yaw_rate": QuantityStyle("yaw rate of the vehicle", "°/s", _DEGREES),
    "world_x": QuantityStyle("x in the world", "m"),
    "world_y": QuantityStyle("y in the world", "m"),
    "world_azimuth": QuantityStyle("azimuth in the world", "°", _DEGREES),
    "edge": QuantityStyle("distance to an edge, near or far"),
    "retro_distance": QuantityStyle("distance to a reflector", "firings"),
    "object_distance": QuantityStyle("distance to an object", "m"),
    "object_size": QuantityStyle("size of the object", "m"),
    "object_place": QuantityStyle("position of the object", "m"),
}
_BESIDE = {"previous": "the previous beam", "above": "the beam above", "below": "the beam below"}
_MEASURED = {"range": ("range", "m"), "intensity": ("intensity", ""), "lost": ("return", "")}


def shown(name: str) -> QuantityStyle:
    """Style in which a covariate is displayed."""
    if name in SHOWN:
        return SHOWN[name]
    side, _, what = name.partition("_")
    if side in _BESIDE and what in _MEASURED:
        measured, unit = _MEASURED[what]
        return QuantityStyle(f"{measured} of {_BESIDE[side]}", unit)
    return QuantityStyle(name.replace("_", " "))
