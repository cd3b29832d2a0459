"""An improved configuration on disk."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from cosim.capture.config import RunConfig
from cosim.drives.writer import explained
from cosim.traffic.behaviour import BehaviourConfig


def write_config(config: RunConfig, path: Path) -> Path:
    """Write what was set in a configuration, and of its behaviour what differs from the preset; returns the path.

    Raises:
        OutputError: it cannot be written.
    """
    values = config.model_dump(mode="json", exclude_unset=True)
    values["behaviour"] = _behaviour(config.behaviour)
    with explained(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(yaml.safe_dump(values, sort_keys=False, allow_unicode=True), encoding="utf-8", newline="\n")
    return path


def _behaviour(behaviour: BehaviourConfig) -> dict[str, Any]:
    plain = BehaviourConfig(preset=behaviour.preset).model_dump(mode="json")
    own = behaviour.model_dump(mode="json")
    changed = {name: _narrow(value) for name, value in own.items() if _narrow(value) != _narrow(plain[name])}
    return {"preset": behaviour.preset, **changed}


def _narrow(value: Any) -> Any:
    """A distribution of no width as the constant it is."""
    if isinstance(value, dict) and value.get("kind") == "uniform" and value["min"] == value["max"]:
        return {"kind": "constant", "value": value["min"]}
    return value
