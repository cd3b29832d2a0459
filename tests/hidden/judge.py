"""Diagnoses one made drive as its user would, in a process of its own: `python -m tests.hidden.judge TASK.json`."""

from __future__ import annotations

import importlib
import inspect
import json
import resource
import sys
import time
from pathlib import Path


def main() -> None:
    """Run the task of a file and write its result where the task says."""
    task = json.loads(Path(sys.argv[1]).read_text())
    from cosim.discrepancy import compare, diagnose

    if task.get("broken_gate"):
        _break_gate()
    started = time.monotonic(), time.process_time()
    page = {"out": Path(task["out"])} if "out" in inspect.signature(diagnose).parameters else {}
    diagnosis = diagnose(Path(task["drive"]), Path(task["sensor"]), **page)
    result = {
        "wall_s": time.monotonic() - started[0],
        "cpu_s": time.process_time() - started[1],
        "rss_gib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
        "diagnosis": diagnosis.to_json(),
    }
    _write(task, result)  # kept even where the comparison below fails
    fitted = result["diagnosis"].get("sensor_out")
    fitted = Path(fitted) if fitted else diagnosis.sensor
    for key, sensor in (("held_out_before", Path(task["sensor"])), ("held_out_after", fitted)):
        result[key] = compare(Path(task["held_out"]), sensor).to_json()
    _write(task, result)


def _break_gate() -> None:
    """Let everything through: what a benchmark that can tell a bad gate from a good one must notice."""
    through = {"LEVEL": float("inf"), "_LEAST_BIC": -float("inf"), "_helps": lambda *_: True, "_MOST_EFFECTS": 1}
    for name, broken in (("diagnose", through), ("second_thoughts", {"_CLEARLY_THERE": -1.0})):
        module = importlib.import_module(f"cosim.discrepancy.{name}")
        assert set(broken) <= set(module.__dict__)
        module.__dict__.update(broken)


def _write(task: dict, result: dict) -> None:
    Path(task["result"]).write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
