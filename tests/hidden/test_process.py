"""A version of the code runs on its own, says what it cost, and is stopped when it takes too long."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import pytest

from tests.hidden.process import Version, run_limited

_ROOT = Path(__file__).resolve().parents[2]


def test_a_command_that_works_has_a_cost_and_no_trouble(tmp_path: Path) -> None:
    ended = Version(_ROOT).run(tmp_path, 60, "effects", "--quiet")
    assert ended.trouble == ""
    assert ended.cpu_s > 0 and ended.rss_gib > 0.01


def test_a_users_mistake_is_reported(tmp_path: Path) -> None:
    ended = Version(_ROOT).run(tmp_path, 60, "compare", tmp_path / "nowhere", "--sensor", "hdl64e")
    assert "nowhere" in ended.trouble and "Traceback" not in ended.trouble


def test_children_count_and_what_takes_too_long_is_stopped(tmp_path: Path) -> None:
    work = "import subprocess, sys; subprocess.run([sys.executable, '-c', 'for i in range(10**7): pass'])"
    ended = run_limited([sys.executable, "-c", work], tmp_path, os.environ, 60)
    alone = run_limited([sys.executable, "-c", "import subprocess"], tmp_path, os.environ, 60)
    assert ended.trouble == "" and ended.cpu_s > alone.cpu_s
    endless = run_limited([sys.executable, "-c", "while True: pass"], tmp_path, os.environ, 1)
    assert endless.trouble == "took longer than 1 CPU seconds"
    assert endless.cpu_s == pytest.approx(1, abs=0.9)


def test_another_code_than_the_one_requested_is_refused(tmp_path: Path) -> None:
    (tmp_path / "cosim").mkdir()
    (tmp_path / "cosim" / "__init__.py").write_text("")
    (tmp_path / "cosim" / "cli.py").write_text("def main(arguments):\n    raise SystemExit('this one')\n")
    assert Version(tmp_path).run(tmp_path, 60, "effects").trouble == "this one"
    shutil.rmtree(tmp_path / "cosim")
    assert "not that of" in Version(tmp_path).run(tmp_path, 60, "effects").trouble
