"""Vehicle types of a town, and random draws from them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sumo_nets.errors import TownError
from sumo_nets.recipe import KindShares
from sumo_nets.vtypes import DRIVING, PARKED, WALKING
from sumo_nets.xml_guard import read_xml

_KIND_OF_CLASS = {"passenger": "car", "delivery": "van", "truck": "truck", "bus": "bus", "coach": "bus"}
_KIND_OF_CLASS |= {"tram": "tram", "motorcycle": "motorcycle", "moped": "motorcycle", "bicycle": "cyclist"}
_KIND_OF_CLASS |= {"pedestrian": "pedestrian"}

Weights = Mapping[str, float]


@dataclass(frozen=True)
class TypeTable:
    """The vehicle types of a town.

    Attributes:
        kinds: kind of every vType id.
        weights: of the vType ids in each of the distributions `driving`, `parked` and `walking`.
    """

    kinds: Mapping[str, str]
    weights: Mapping[str, Weights]

    def driving(self, shares: KindShares, count: int, rng: np.random.Generator) -> list[str]:
        """Return the types of vehicles on the move, kinds by `shares`, types within a kind as the town has them.

        Raises:
            TownError: the town has no type of any kind wanted.
        """
        within = self.weights[DRIVING]
        total = {kind: sum(w for t, w in within.items() if self.kinds[t] == kind) for kind in set(self.kinds.values())}
        wanted = shares.model_dump()
        weights = {
            t: wanted[self.kinds[t]] * w / total[self.kinds[t]]
            for t, w in within.items()
            if w > 0 and wanted.get(self.kinds[t], 0.0) > 0
        }
        return _draw(weights, count, rng, "moving of the requested kinds")

    def parked(self, count: int, rng: np.random.Generator, kind: str | None = None) -> list[str]:
        """Return the types of parked vehicles, of all kinds or one."""
        weights = {t: w for t, w in self.weights[PARKED].items() if kind in (None, self.kinds[t])}
        return _draw(weights, count, rng, "that parks")

    def walking(self, count: int, rng: np.random.Generator) -> list[str]:
        """Return the types of people on foot."""
        return _draw(self.weights[WALKING], count, rng, "of pedestrians")

    def trams(self, count: int, rng: np.random.Generator) -> list[str]:
        """Return the types of trams, each equally likely."""
        return _draw({name: 1.0 for name, kind in self.kinds.items() if kind == "tram"}, count, rng, "of trams")

    def is_bicycle(self, name: str) -> bool:
        """Whether a type rides a bicycle."""
        return self.kinds[name] == "cyclist"


def read_types(paths: Iterable[Path]) -> TypeTable:
    """Return the vehicle types that additional files define.

    A distribution that is missing is made of all types that suit it, each as likely as any other.

    Raises:
        TownError: a file is not XML, or no type is defined.
    """
    roots = [read_xml(path) for path in paths]
    types = {
        element.get("id", ""): _KIND_OF_CLASS[element.get("vClass", "passenger")]
        for root in roots
        for element in root.iter("vType")
        if element.get("vClass", "passenger") in _KIND_OF_CLASS
    }
    if not types:
        raise TownError("the town's additional files define no vType that cosim knows; add some, one for each kind")
    vehicles = [name for name, kind in types.items() if kind not in ("pedestrian", "tram")]
    weights: dict[str, Weights] = {
        DRIVING: dict.fromkeys(vehicles, 1.0),
        PARKED: {name: 1.0 for name in vehicles if types[name] in ("car", "van")},
        WALKING: {name: 1.0 for name, kind in types.items() if kind == "pedestrian"},
    }
    for root in roots:
        for element in root.iter("vTypeDistribution"):
            if element.get("id") in weights:
                weights[element.get("id", "")] = _weights(element, types)
    return TypeTable(types, weights)


def _weights(element: ET.Element, types: Mapping[str, str]) -> Weights:
    names = element.get("vTypes", "").split()
    chances = [float(text) for text in element.get("probabilities", "").split()] or [1.0] * len(names)
    return {name: chance for name, chance in zip(names, chances, strict=True) if name in types}


def _draw(weights: Weights, count: int, rng: np.random.Generator, what: str) -> list[str]:
    if count == 0:
        return []
    chances = np.array(list(weights.values()), dtype=np.float64)
    if chances.sum() <= 0:
        raise TownError(f"the town has no vType {what}; request none, or add one to its additional file")
    return rng.choice(list(weights), size=count, p=chances / chances.sum()).tolist()
