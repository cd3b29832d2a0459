"""Makers of unknown effects of every kind; each draws its covariates, channel, size and shape from a seed.

A kind is a weight (n,) of beams, about −1…1 (0…1 for losses), times a size, in a channel: metres added to the range,
a relative change of the intensity, or a probability of loss. `noise_shape` alone has no weight: it is a law of noise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.hidden.columns import COLUMNS, firing, incidence, kind, made_of, measured_intensity, neighbour
from tests.hidden.scan import Scan
from tests.hidden.truth import Told

Parameters = Mapping[str, Any]
Draw = Callable[[np.random.Generator, str], dict[str, Any]]
Weight = Callable[[Scan, np.random.Generator, Parameters], np.ndarray]

# One standard deviation of the point noise is 2 cm of range and 10 % of intensity.
_SIZES = {
    ("range", "strong"): (0.03, 0.06),
    ("range", "half"): (0.008, 0.012),
    ("intensity", "strong"): (0.15, 0.30),
    ("intensity", "half"): (0.04, 0.06),
    ("drop", "strong"): (0.15, 0.35),
    ("drop", "half"): (0.04, 0.08),
}
_CHANNELS = ("range", "intensity", "drop")
_PER_LASER = {"range": ("ring_range_offset",), "intensity": ("ring_gain",), "drop": ()}


@dataclass(frozen=True)
class Kind:
    """A kind of unknown effect.

    Attributes:
        draw: generator, `strong` or `half` → parameters that JSON can hold, `channel` and `size` among them.
        weight: scan, generator, parameters → (n,) share of the size.
        told: parameters → what a diagnosis should say.
        late: parameters → acts on what is measured, after detection.
    """

    draw: Draw
    weight: Weight
    told: Callable[[Parameters], Told]
    late: Callable[[Parameters], bool] = lambda p: False

    def act(self, scan: Scan, rng: np.random.Generator, parameters: Parameters) -> None:
        """Change the scan."""
        value = parameters["size"] * self.weight(scan, rng, parameters)
        if parameters["channel"] == "range":
            scan.range_m += value
        elif parameters["channel"] == "intensity":
            scan.intensity *= np.maximum(1 + value, 0.05)
        else:
            scan.found &= rng.random(len(scan.found)) >= value


def _sized(rng: np.random.Generator, channel: str, level: str, signed: bool = True) -> dict[str, Any]:
    low, high = _SIZES[channel, level]
    sign = rng.choice([-1, 1]) if signed and channel != "drop" else 1
    return {"channel": channel, "size": round(float(sign * rng.uniform(low, high)), 4)}


def _pick(rng: np.random.Generator, choices) -> Any:
    return choices[int(rng.integers(len(choices)))]


def _uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return round(float(rng.uniform(low, high)), 4)


# One covariate. Shapes that a catalogue effect has (a straight line in range, a fall over range) are left out.
_HUMPS, _ALL = ("bell", "step"), ("bell", "step", "ramp", "saturating")
_SHAPES_OF = {
    **{(channel, name): _ALL for channel in _CHANNELS for name in ("elevation", "ring", "previous_intensity")},
    **{(channel, "azimuth"): ("bell", "step", "ramp") for channel in _CHANNELS},
    **{(channel, name): _HUMPS for channel in _CHANNELS for name in ("range", "incidence", "albedo")},
    ("range", "intensity"): _HUMPS,
}


def _draw_one(rng: np.random.Generator, level: str) -> dict[str, Any]:
    channel = _pick(rng, _CHANNELS)
    covariate = _pick(rng, [name for where, name in _SHAPES_OF if where == channel])
    shape = _pick(rng, _SHAPES_OF[channel, covariate])
    where = {"covariate": covariate, "shape": shape, "centre": _uniform(rng, 0.25, 0.7)}
    return _sized(rng, channel, level) | where | {"width": _uniform(rng, 0.1, 0.25)}


def _weight_one(scan: Scan, rng: np.random.Generator, p: Parameters) -> np.ndarray:
    x = np.clip(COLUMNS[p["covariate"]].unit(scan), 0, 1)
    if p["shape"] == "bell":
        return np.exp(-(((x - p["centre"]) / p["width"]) ** 2))
    if p["shape"] == "step":
        return (x > p["centre"]).astype(float)
    if p["shape"] == "ramp":
        return x if p["channel"] == "drop" else 2 * x - 1
    return 1 - np.exp(-x / p["width"])


def _told_one(p: Parameters) -> Told:
    by_laser = _PER_LASER[p["channel"]] if p["covariate"] in ("ring", "elevation") else ()
    return Told((p["channel"],), (COLUMNS[p["covariate"]].accepted,), by_laser)


# A pair: a product of two centred functions, so that neither alone moves the mean.
def _log_range(scan: Scan) -> np.ndarray:
    return np.tanh(np.log(np.maximum(scan.range_m, 0.1) / 8.5) / 0.8)


_CENTRED: dict[str, Callable[[Scan], np.ndarray]] = {
    "range": _log_range,
    "incidence": lambda scan: np.clip((incidence(scan) - 1.03) / 0.5, -1, 1),
    "ring": lambda scan: 2 * (scan.beams.ring + 0.5) / scan.beams.rings - 1,
    "albedo": lambda scan: np.clip((scan.rho - 0.35) / 0.3, -1, 1),
}
_PAIRS = (
    ("range", "azimuth"),
    ("incidence", "azimuth"),
    ("ring", "azimuth"),
    ("albedo", "azimuth"),
    ("range", "albedo"),
)


def _draw_pair(rng: np.random.Generator, level: str) -> dict[str, Any]:
    first, second = _pick(rng, _PAIRS)
    turn = {"waves": int(rng.integers(1, 4)), "phase_deg": _uniform(rng, 0, 360)} if second == "azimuth" else {}
    size = _sized(rng, _pick(rng, ("range", "intensity")), level)
    # A product of two is small for most beams: twice the size moves them as much as one covariate does.
    return size | {"size": 2 * size["size"], "first": first, "second": second} | turn


def _weight_pair(scan: Scan, rng: np.random.Generator, p: Parameters) -> np.ndarray:
    first = _CENTRED[p["first"]](scan)
    if p["second"] == "azimuth":
        return first * np.sin(p["waves"] * scan.beams.azimuth + np.radians(p["phase_deg"]))
    return first * _CENTRED[p["second"]](scan)


def _told_pair(p: Parameters) -> Told:
    return Told((p["channel"],), (COLUMNS[p["first"]].accepted, COLUMNS[p["second"]].accepted))


# Neighbours: what they measured, or that they measured nothing.
_LOOKS = {
    ("above_intensity", "range"): ("above_intensity",),
    ("above_intensity", "intensity"): ("above_intensity",),
    ("above_intensity", "drop"): ("above_intensity",),
    ("below_intensity", "range"): ("below_intensity",),
    ("below_intensity", "intensity"): ("below_intensity",),
    ("previous_intensity", "intensity"): ("previous_intensity",),
    ("previous_intensity", "drop"): ("previous_intensity",),
    ("above_range", "range"): ("above_range",),
    ("previous_range", "range"): ("previous_range",),
    ("previous_lost", "drop"): ("previous_lost", "neighbour_lost", "previous_range", "previous_intensity"),
    ("previous_lost", "intensity"): ("previous_lost", "neighbour_lost", "previous_range", "previous_intensity"),
    ("neighbour_lost", "drop"): ("neighbour_lost", "above_range", "above_intensity", "below_intensity"),
}


def _draw_neighbour(rng: np.random.Generator, level: str) -> dict[str, Any]:
    look, channel = _pick(rng, list(_LOOKS))
    return _sized(rng, channel, level) | {"look": look}


def _weight_neighbour(scan: Scan, rng: np.random.Generator, p: Parameters) -> np.ndarray:
    which, what = p["look"].split("_")
    if what == "intensity":
        light = neighbour(scan, measured_intensity(scan), which, 0.0)
        return np.minimum(light / 0.5, 1.5)
    lost = (~scan.found).astype(float)
    if what == "lost":
        if which == "previous":
            return neighbour(scan, lost, "previous", 0.0)
        return np.maximum(neighbour(scan, lost, "above", 0.0), neighbour(scan, lost, "below", 0.0))
    measured = np.where(scan.found, scan.range_m, np.nan)
    step_m = 1.0 if which == "above" else 0.1  # rings lie metres apart on the ground, firings centimetres
    return np.nan_to_num(np.tanh((neighbour(scan, measured, which, np.nan) - scan.range_m) / step_m))


def _told_neighbour(p: Parameters) -> Told:
    return Told((p["channel"],), (_LOOKS[p["look"], p["channel"]],))


# A class of road user, or a material.
CLASSES = {
    "cars": ("car", "van", "truck", "bus"),
    "people": ("pedestrian", "cyclist", "motorcycle"),
}
_MATERIALS = ("asphalt", "hedge", "plaster_white", "paving", "grass", "car_paint", "brick", "kerb")
_OF_MATERIAL = ("material", "albedo", "model")
_OF_CLASS = ("class", "kind", "model", "instance", "material")


def _draw_class(rng: np.random.Generator, level: str) -> dict[str, Any]:
    channel = _pick(rng, _CHANNELS)
    where = _pick(rng, ({"objects": "cars"}, {"objects": "people"}, {"material": _pick(rng, _MATERIALS)}))
    return _sized(rng, channel, level) | where


def _weight_class(scan: Scan, rng: np.random.Generator, p: Parameters) -> np.ndarray:
    if "material" in p:
        return made_of(scan, (p["material"],)).astype(float)
    return np.isin(kind(scan), CLASSES[p["objects"]]).astype(float)


def _told_class(p: Parameters) -> Told:
    names = _OF_CLASS if "objects" in p else _OF_MATERIAL
    if p.get("material") == "car_paint":
        names = (*_OF_MATERIAL, "class", "kind", "instance")
    return Told((p["channel"],), (names,))


# Periodic: along the firings of a revolution, or in time.
def _draw_periodic(rng: np.random.Generator, level: str) -> dict[str, Any]:
    channel = _pick(rng, ("drop", "range", "intensity"))
    size = _sized(rng, channel, level, signed=False)
    if channel != "drop" and rng.random() < 0.5:
        return size | {"of": "time", "period_s": _uniform(rng, 2.3, 9.0), "phase_deg": _uniform(rng, 0, 360)}
    return size | {"of": "firing", "period": _uniform(rng, 8, 40), "duty": _uniform(rng, 0.2, 0.4)}


def _weight_periodic(scan: Scan, rng: np.random.Generator, p: Parameters) -> np.ndarray:
    if p["of"] == "time":
        time_s = scan.elapsed_s + scan.beams.time_s
        return np.sin(2 * np.pi * time_s / p["period_s"] + np.radians(p["phase_deg"]))
    turn = firing(scan) / p["period"]
    if p["channel"] == "drop":
        return (np.mod(turn, 1) < p["duty"]).astype(float)
    return np.sin(2 * np.pi * turn)


def _told_periodic(p: Parameters) -> Told:
    if p["of"] == "time":
        return Told((p["channel"],), (("frame_time", "time", "phase", "scan"),))
    return Told((p["channel"],), (("phase", "azimuth", "firing_time"),))


# A level of its own for each scan.
def _draw_scan(rng: np.random.Generator, level: str) -> dict[str, Any]:
    return _sized(rng, _pick(rng, _CHANNELS), level, signed=False) | {"seed": int(rng.integers(1 << 30))}


def _weight_scan(scan: Scan, rng: np.random.Generator, p: Parameters) -> np.ndarray:
    of_scan = np.random.default_rng([p["seed"], round(scan.elapsed_s * 100)])
    level = of_scan.uniform(0, 1.5) if p["channel"] == "drop" else of_scan.normal()
    return np.full(len(scan.found), level)


def _told_scan(p: Parameters) -> Told:
    return Told((p["channel"],), (("scan", "frame_time"),))


# The noise's shape, at the variance that the model has.
_LAWS = ("two_humps", "skewed", "uniform")
_SHARES = {"strong": (0.85, 0.95), "half": (0.55, 0.65)}


def _draw_noise(rng: np.random.Generator, level: str) -> dict[str, Any]:
    return {
        "channel": _pick(rng, ("range", "intensity")),
        "law": _pick(rng, _LAWS),
        "share": _uniform(rng, *_SHARES[level]),
        "mirrored": bool(rng.random() < 0.5),
        "size": 0.0,
    }


def noise_law(p: Parameters, base: Callable) -> Callable[[np.random.Generator, int], np.ndarray]:
    """A law of mean 0 and standard deviation 1, of whose variance `share` has the shape and the rest is `base`."""

    def shaped(rng: np.random.Generator, n: int) -> np.ndarray:
        if p["law"] == "two_humps":
            x = rng.choice([-1.0, 1.0], n)
        elif p["law"] == "skewed":
            x = rng.exponential(size=n) - 1
        else:
            x = rng.uniform(-(3**0.5), 3**0.5, n)
        x = -x if p["mirrored"] else x
        return p["share"] ** 0.5 * x + (1 - p["share"]) ** 0.5 * base(rng, n)

    return shaped


def _told_noise(p: Parameters) -> Told:
    return Told((p["channel"], f"{p['channel']}_variance"), (("noise_shape",),))


# Porous surfaces: the return comes from somewhere behind the first blade. Of leaves the catalogue knows that.
_POROUS = (("grass",), ("grass", "soil"), ("grass", "gravel"))


def _draw_porous(rng: np.random.Generator, level: str) -> dict[str, Any]:
    size = _sized(rng, "range", level, signed=False)
    return size | {"materials": list(_pick(rng, _POROUS))}


def _weight_porous(scan: Scan, rng: np.random.Generator, p: Parameters) -> np.ndarray:
    return made_of(scan, tuple(p["materials"])) * rng.exponential(size=len(scan.found))


def _told_porous(p: Parameters) -> Told:
    return Told(("range", "range_variance"), ((*_OF_MATERIAL, "class"),))


KINDS: dict[str, Kind] = {
    "one_covariate": Kind(_draw_one, _weight_one, _told_one),
    "pair": Kind(_draw_pair, _weight_pair, _told_pair),
    "neighbours": Kind(_draw_neighbour, _weight_neighbour, _told_neighbour, lambda p: p["look"].endswith("lost")),
    "class_or_material": Kind(_draw_class, _weight_class, _told_class),
    "periodic": Kind(_draw_periodic, _weight_periodic, _told_periodic),
    "scan_level": Kind(_draw_scan, _weight_scan, _told_scan),
    "noise_shape": Kind(_draw_noise, lambda scan, rng, p: np.zeros(len(scan.found)), _told_noise),
    "porous": Kind(_draw_porous, _weight_porous, _told_porous),
}
_MOST_DRAWS = 1000


def draw_two(rng: np.random.Generator, level: str) -> dict[str, dict[str, Any]]:
    """Two unknown effects of different kinds in different channels.

    Raises:
        RuntimeError: none were drawn, which means that no two kinds differ in channel.
    """
    for _ in range(_MOST_DRAWS):
        names = rng.choice(list(KINDS), 2, replace=False)
        two = {str(name): KINDS[name].draw(rng, level) for name in names}
        if len({entry["channel"] for entry in two.values()}) == len(two):
            return two
    raise RuntimeError(f"no two of {', '.join(KINDS)} act in different channels")
