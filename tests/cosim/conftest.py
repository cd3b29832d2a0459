"""The command line, as tests call it."""

from __future__ import annotations

import subprocess
import sys


def cosim(*arguments: object, check: bool = True, timeout: float = 600) -> subprocess.CompletedProcess[str]:
    """Run the command line in a process of its own, as a user does."""
    command = [sys.executable, "-c", "import sys; from cosim.cli import main; sys.exit(main())"]
    result = subprocess.run([*command, *map(str, arguments)], capture_output=True, text=True, timeout=timeout)
    if check:
        assert result.returncode == 0, result.stderr
    return result
