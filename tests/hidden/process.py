"""Runs a version of `cosim` in a process of its own, and says what it cost."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

_JUDGE = Path(__file__).with_name("judge.py")
_POLL_S = 0.1
_MOST_WALL = 20  # wall seconds for each CPU second allowed: on a busy machine a process waits more than it works


@dataclass(frozen=True)
class Ended:
    """How a process went.

    Attributes:
        trouble: what it said when it failed, or that it was stopped; empty when all is well.
        wall_s, cpu_s: time it took; CPU seconds of user and system, its children's included.
        rss_gib: largest memory of any of its processes.
    """

    trouble: str
    wall_s: float
    cpu_s: float
    rss_gib: float


@dataclass(frozen=True)
class Version:
    """A repository whose `cosim` is tried.

    Attributes:
        code: its root.
    """

    code: Path

    def run(self, work: Path, limit_s: float, *arguments: str | Path) -> Ended:
        """One command of `cosim`, in a folder, stopped after so many CPU seconds."""
        command = [self._python, "-P", str(_JUDGE), str(self.code), *map(str, arguments)]
        one_thread = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        return run_limited(command, work, {**os.environ, **one_thread, "PYTHONPATH": str(self.code)}, limit_s)

    @property
    def _python(self) -> str:
        own = self.code / ".venv" / "bin" / "python"
        return str(own) if own.exists() else sys.executable


def run_limited(command: list[str], work: Path, environment: Mapping[str, str], limit_s: float) -> Ended:
    """Run a command in a folder, and stop it after so many CPU seconds of one of its processes."""
    message, started = work / "said.txt", time.monotonic()
    with message.open("w") as out:
        process = subprocess.Popen(
            command, cwd=work, env=environment, stdout=out, stderr=subprocess.STDOUT, start_new_session=True
        )
        resource.prlimit(process.pid, resource.RLIMIT_CPU, (round(limit_s), round(limit_s) + 1))
        late, status, usage = _waited(process.pid, started + _MOST_WALL * limit_s)
    process.returncode = os.waitstatus_to_exitcode(status)
    trouble = ""
    if late or process.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        trouble = f"took longer than {limit_s:.0f} CPU seconds"
    elif process.returncode:
        trouble = message.read_text().strip()[-1500:] or f"ended with {process.returncode}"
    cpu_s = usage.ru_utime + usage.ru_stime
    return Ended(trouble, time.monotonic() - started, cpu_s, usage.ru_maxrss / 2**20)


def _waited(pid: int, until: float):
    """Whether a process had to be stopped, its status and its usage."""
    stopped = False
    while True:
        ended, status, usage = os.wait4(pid, os.WNOHANG)
        if ended:
            return stopped, status, usage
        if not stopped and time.monotonic() > until:
            os.killpg(pid, signal.SIGKILL)
            stopped = True
        time.sleep(_POLL_S)
