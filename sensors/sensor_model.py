"""A sensor: a beam pattern and the effects that make it real, read from a small file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import yaml

from sensors.errors import SensorError
from sensors.hits import Hits
from sensors.pattern import Pattern, load_pattern, pattern_names
from sensors.point_cloud import PointCloud, bare_returns


@dataclass(frozen=True)
class SensorModel:
    """A LiDAR.

    Attributes:
        pattern: its beams.
    """

    pattern: Pattern

    def measure(self, hits: Hits) -> PointCloud:
        """The points it reports of traced hits."""
        return bare_returns(hits)

    def to_yaml(self) -> str:
        """The sensor file; it names the pattern, which is stored beside it."""
        return yaml.safe_dump({"pattern": self.pattern.name, "effects": []}, sort_keys=False)


def load_sensor(name_or_path: str | Path) -> SensorModel:
    """A sensor from its file, or a bare one from the name of a pattern.

    Raises:
        SensorError: no such file or pattern, an unknown key or effect.
    """
    text = str(name_or_path)
    if text in pattern_names():
        return SensorModel(load_pattern(text))
    path = Path(text)
    if not path.is_file():
        raise SensorError(
            f"sensor {text!r} does not exist; give the path of a sensor file or a pattern: {', '.join(pattern_names())}"
        )
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise SensorError(f"sensor {path} cannot be read: {' '.join(str(error).split())}") from error
    if not isinstance(values, dict) or not isinstance(values.get("pattern"), str):
        raise SensorError(f"sensor {path} names no pattern; write `pattern: hdl64e`")
    unknown = sorted(set(values) - {"pattern", "effects"})
    if unknown:
        raise SensorError(f"sensor {path}: unknown key {unknown[0]!r}; use pattern and effects")
    effects = values.get("effects") or []
    if not isinstance(effects, list):
        raise SensorError(f"sensor {path}: effects is {effects!r}; give a list")
    if effects:
        named = effects[0].get("effect", effects[0]) if isinstance(effects[0], dict) else effects[0]
        raise SensorError(f"sensor {path}: effect {named!r} is unknown; remove it")
    beside = path.parent / values["pattern"]
    return SensorModel(load_pattern(beside if beside.is_file() else values["pattern"]))
