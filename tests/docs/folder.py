"""The folder that a page's blocks are run in."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from tests.docs.blocks import ROOT, Block, read_blocks

_LONGEST_S = {"quick": 600, "slow": 3600}


class PageFolder:
    """Runs the blocks of one page, each once and in their order, each in a process of its own.

    Args:
        page: whose.
        folder: empty.
        lay_in: puts what the page says is given into the folder; called before the first program is run.
    """

    def __init__(self, page: str, folder: Path, lay_in: Callable[[Path], None]) -> None:
        self._folder = folder
        self._lay_in: Callable[[Path], None] | None = lay_in
        self._blocks = [block for block in read_blocks(page) if block.acts and block.when != "never"]
        self._failed: dict[int, str] = {}
        self._done: set[int] = set()
        self._imports: list[str] = []

    def reach(self, wanted: Block) -> None:
        """Run all blocks before one, and it: slow ones only on the way to a slow one."""
        for block in self._blocks:
            if block.line > wanted.line:
                break
            if block.line not in self._done and (block.when == "quick" or wanted.when == "slow"):
                self._done.add(block.line)
                problem = self._tried(block)
                if problem:
                    self._failed[block.line] = problem
        assert wanted.line not in self._failed, self._failed[wanted.line]

    def _tried(self, block: Block) -> str:
        """What went wrong; empty if nothing did."""
        if block.title:
            file = self._folder / block.title
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(block.program, encoding="utf-8")
            return ""
        if self._lay_in is not None:
            self._lay_in(self._folder)
            self._lay_in = None
        if block.language == "bash":
            command = ["bash", "-euo", "pipefail", "-c", block.program]
        else:
            script = self._folder / f"block_{block.line}.py"
            script.write_text("\n".join([*self._imports, block.program]), encoding="utf-8")
            self._imports += imports(block.program)
            command = [sys.executable, str(script)]
        try:
            done = subprocess.run(
                command,
                cwd=self._folder,
                env=environment(),
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                timeout=_LONGEST_S[block.when],
            )
        except subprocess.TimeoutExpired as error:
            return f"{block.page}:{block.line} took longer than {error.timeout:g} s"
        if done.returncode == 0:
            return ""
        return f"{block.page}:{block.line} ended with {done.returncode}\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}"


def imports(program: str) -> list[str]:
    """Import statements of a program; later blocks of a page go on with what is imported."""
    return [ast.unparse(one) for one in ast.parse(program).body if isinstance(one, ast.Import | ast.ImportFrom)]


def environment() -> Mapping[str, str]:
    """That of a user who has activated the virtual environment."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    return {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "COLUMNS": "120"}


Provide = Callable[[Path], None]
"""Puts something at a path."""
