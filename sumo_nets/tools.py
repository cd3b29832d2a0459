"""Running SUMO's programs and cleaning the files they write."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

from sumo_nets.errors import TownError

_COMMENT = re.compile(r"<!--.*?-->\s*", re.DOTALL)


def sumo_home() -> Path:
    """Return the folder of the installed SUMO, which holds `bin` and `tools`."""
    import sumo

    return Path(sumo.SUMO_HOME)


def run_tool(tool: str, *arguments: str | Path, cwd: Path | None = None, timeout_s: float = 300.0) -> str:
    """Run one of SUMO's programs and return its standard output.

    Args:
        tool: program name, such as `netconvert`.
        arguments: its command line.
        cwd: working folder.
        timeout_s: wall-clock limit.

    Raises:
        TownError: the program failed or ran too long; the message ends with its first error line.
    """
    command, environment = tool_command(tool, *arguments)
    try:
        done = subprocess.run(
            command, cwd=cwd, env=environment, capture_output=True, text=True, errors="replace", timeout=timeout_s
        )
    except subprocess.TimeoutExpired as error:
        raise TownError(f"{tool} did not finish within {timeout_s:g} s") from error
    except OSError as error:
        raise TownError(f"{tool} could not be started: {error}") from error
    if done.returncode < 0:
        raise TownError(f"{tool} crashed (signal {-done.returncode})")
    if done.returncode != 0:
        raise TownError(f"{tool} failed: {first_error(done.stderr)}")
    return done.stdout


def tool_command(tool: str, *arguments: str | Path) -> tuple[list[str], dict[str, str]]:
    """Return the command line and the environment in which one of SUMO's programs runs."""
    home = sumo_home()
    return [str(home / "bin" / tool), *map(str, arguments)], {**os.environ, "SUMO_HOME": str(home)}


def first_error(text: str) -> str:
    """Return the first error line of a SUMO program's output, without its `Error:` prefix."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("Error")]
    return (errors or lines or ["no message"])[0].removeprefix("Error:").strip()


def strip_comments(path: Path) -> None:
    """Remove the comments of an XML file: they hold the date, the command line and absolute paths."""
    text = _COMMENT.sub("", path.read_text(encoding="utf-8"))
    path.write_text(text, encoding="utf-8", newline="\n")
