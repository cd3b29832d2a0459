"""The other end of a child process: starts it, gives it tasks, hears its events, ends it."""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
import time
from multiprocessing.connection import Connection
from typing import Any

from cosim.engine.jobs import Event, Job

_PATIENCE_S = 10.0
_START_S = 120.0
# Matrix products here are too small for BLAS to gain by threads; on busy cores it loses much.
_WITHOUT_BLAS_THREADS = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


class Child:
    """A process that opened a job.

    Args:
        job: what it opens.
        threads: how many threads it may use.
        folder: its working directory; by default this process's.
    """

    def __init__(self, job: Job, threads: int, *, folder: str | None = None) -> None:
        ours, theirs = socket.socketpair()
        environment = {
            **os.environ,
            **_WITHOUT_BLAS_THREADS,
            "LP_NUM_THREADS": str(threads if threads > 1 else 0),
            "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
        }
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "cosim.engine.child", str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                env=environment,
                cwd=folder,
            )
        self.connection = Connection(ours.detach())
        self._heard_s = time.monotonic()
        self._opened = False
        self._send((job, threads))

    def give(self, task: Any) -> None:
        """Have a task done next."""
        self._heard_s = time.monotonic()
        self._send(task)

    def hear(self) -> Event | None:
        """The next event, or None where the process is dead."""
        try:
            event = self.connection.recv()
        except (EOFError, OSError):
            return None
        self._heard_s = time.monotonic()
        self._opened = True
        return event

    def hangs(self, patience_s: float) -> bool:
        """Whether it has told nothing for too long; one that is only starting may take a while."""
        return time.monotonic() - self._heard_s > (patience_s if self._opened else max(patience_s, _START_S))

    def obituary(self) -> str:
        """What a dead process died of."""
        code = self._process.wait(_PATIENCE_S)
        if code < 0:
            hint = " (often too little memory)" if code == -9 else ""
            return f"its process was killed by signal {-code}{hint}"
        return f"its process ended with exit code {code}"

    def dismiss(self) -> None:
        """Let it end, having nothing more to do."""
        self._send(None)
        try:
            self._process.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.kill()
        self.connection.close()

    def kill(self) -> None:
        """End it now, whatever it does."""
        self._process.kill()
        self._process.wait()

    def _send(self, item: Any) -> None:
        with contextlib.suppress(OSError):  # it is dead, which `hear` tells
            self.connection.send(item)
