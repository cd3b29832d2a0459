"""Runs one command of `cosim` as a user would: `python -P judge.py CODE whole|broken COMMAND …`.

CODE is the repository whose `cosim` runs; nothing of `tests.hidden` is in sight of it.
"""

import importlib
import sys
from pathlib import Path


def main() -> int:
    """The command's exit code."""
    code, gate, *arguments = sys.argv[1:]
    import cosim
    from cosim.cli import main as command

    if Path(code) not in Path(str(cosim.__file__)).parents:
        raise SystemExit(f"cosim is {cosim.__file__}, not that of {code}; start with PYTHONPATH={code}")
    if gate == "broken":
        _break_gate()
    return command(arguments)


def _break_gate() -> None:
    """Let everything through: what a benchmark that can tell a bad gate from a good one must notice."""
    through = {"LEVEL": float("inf"), "_LEAST_BIC": -float("inf"), "_helps": lambda *_: True, "_MOST_EFFECTS": 1}
    for name, broken in (("diagnose", through), ("second_thoughts", {"_CLEARLY_THERE": -1.0})):
        module = importlib.import_module(f"cosim.discrepancy.{name}")
        assert set(broken) <= set(module.__dict__)
        module.__dict__.update(broken)


if __name__ == "__main__":
    sys.exit(main())
