"""Runs one command of `cosim` in a process of its own: `python -P judge.py CODE COMMAND …`.

CODE is the repository whose `cosim` runs; nothing of `tests.hidden` can be imported by it.
"""

import sys
from pathlib import Path


def main() -> int:
    """Return the command's exit code."""
    code, *arguments = sys.argv[1:]
    import cosim
    from cosim.cli import main as command

    if Path(code) not in Path(str(cosim.__file__)).parents:
        raise SystemExit(f"cosim is {cosim.__file__}, not that of {code}; start with PYTHONPATH={code}")
    return command(arguments)


if __name__ == "__main__":
    sys.exit(main())
