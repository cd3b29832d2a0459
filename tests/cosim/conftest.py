"""The command line, as tests call it."""

from __future__ import annotations

import contextlib
import io
import subprocess
import sys

from cosim.cli import main


def cosim(*arguments: object, check: bool = True, timeout: float = 600) -> subprocess.CompletedProcess[str]:
    """Run the command line in a process of its own, as a user does; for what simulates or is to be killed."""
    command = [sys.executable, "-c", "import sys; from cosim.cli import main; sys.exit(main())"]
    result = subprocess.run([*command, *map(str, arguments)], capture_output=True, text=True, timeout=timeout)
    if check:
        assert result.returncode == 0, result.stderr
    return result


def refused(*arguments: object) -> str:
    """What the command line says to bad input: one line on stderr, with exit code 2."""
    message, printed = io.StringIO(), io.StringIO()
    with contextlib.redirect_stderr(message), contextlib.redirect_stdout(printed):
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as end:  # the parser's own complaints
            code = end.code
    text = message.getvalue()
    assert code == 2 and text.count("\n") == 1 and "Traceback" not in text, (code, text)
    return text.rstrip("\n")
