"""Start a child process, send it tasks, receive its events and stop it."""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
import time
from multiprocessing.connection import Connection
from typing import Any

from cosim.engine.heap import SMALL_HEAP
from cosim.engine.jobs import Job, JobEvent

_EXIT_S = 10.0
_START_S = 120.0
# Matrix products are too small to benefit from BLAS threads, which slow down the other processes.
_WITHOUT_BLAS_THREADS = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


class Child:
    """A child process that opens a job and executes tasks.

    Args:
        job: job to open.
        threads: number of threads that the child may use.
        folder: working directory of the child; by default that of this process.
    """

    def __init__(self, job: Job, threads: int, *, folder: str | None = None) -> None:
        ours, theirs = socket.socketpair()
        environment = {
            **SMALL_HEAP,
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
        self._last_event_s = time.monotonic()
        self._is_open = False
        self._send((job, threads))

    def send_task(self, task: Any) -> None:
        """Send the next task."""
        self._last_event_s = time.monotonic()
        self._send(task)

    def receive(self) -> JobEvent | None:
        """Receive the next event; None if the process is dead."""
        try:
            event = self.connection.recv()
        except (EOFError, OSError):
            return None
        self._last_event_s = time.monotonic()
        self._is_open = True
        return event

    def is_hanging(self, patience_s: float) -> bool:
        """Whether the last event is more than `patience_s` ago; a starting process has at least `_START_S`."""
        return time.monotonic() - self._last_event_s > (patience_s if self._is_open else max(patience_s, _START_S))

    def exit_reason(self) -> str:
        """Signal or exit code of a dead process, as text."""
        code = self._process.wait(_EXIT_S)
        if code < 0:
            hint = " (often too little memory)" if code == -9 else ""
            return f"its process was killed by signal {-code}{hint}"
        return f"its process ended with exit code {code}"

    def shut_down(self) -> None:
        """Ask the process to exit, and kill it if it does not."""
        self._send(None)
        try:
            self._process.wait(_EXIT_S)
        except subprocess.TimeoutExpired:
            self.kill()
        self.connection.close()

    def kill(self) -> None:
        """Kill the process."""
        self._process.kill()
        self._process.wait()

    def _send(self, item: Any) -> None:
        with contextlib.suppress(OSError):  # the process is dead, which `receive` reports
            self.connection.send(item)
