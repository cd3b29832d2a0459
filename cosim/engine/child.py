"""Child process that executes tasks one after the other: `python -m cosim.engine.child FD`, FD being its socket."""

from __future__ import annotations

import gc
import os
import queue
import resource
import signal
import sys
import threading
import traceback
from multiprocessing.connection import Connection
from pathlib import Path

from cosim.engine.jobs import Job, JobEvent
from cosim.user_errors import user_errors

_GC_THRESHOLDS = (50_000, 20, 50)  # collect rarely, because reference cycles are rare
_PROCESS_STATUS = Path("/proc/self/status")


def main(descriptor: int) -> None:
    """Execute the tasks received through the socket until None is received or the socket is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent receives it, too, and stops its children
    gc.set_threshold(*_GC_THRESHOLDS)
    connection = Connection(descriptor)
    job, threads = connection.recv()
    tasks: queue.SimpleQueue = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(connection, tasks), daemon=True).start()
    tell = _EventSender(connection)
    try:
        _run_tasks(job, threads, tasks, tell)
    except user_errors() as error:
        tell(JobEvent("refused", str(error)))
    except Exception:  # noqa: BLE001 — every error is reported to the parent
        tell(JobEvent("failed", traceback.format_exc()))


def _run_tasks(job: Job, threads: int, tasks: queue.SimpleQueue, tell: _EventSender) -> None:
    with job.open(threads) as do:
        tell(JobEvent("opened"))
        gc.freeze()  # exclude the objects of the open job from later collections
        while (task := tasks.get()) is not None:
            do(task, tell)
            tell(JobEvent("task", peak_bytes=peak_bytes()))


def _listen(connection: Connection, tasks: queue.SimpleQueue) -> None:
    """Forward tasks to the queue; exit if the parent dies, so that no orphan continues to write files."""
    try:
        while True:
            task = connection.recv()
            tasks.put(task)
            if task is None:
                return
    except (EOFError, OSError):
        os._exit(1)


class _EventSender:
    """Sends events to the parent; thread-safe."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._lock = threading.Lock()

    def __call__(self, event: JobEvent) -> None:
        try:
            with self._lock:
                self._connection.send(event)
        except OSError:
            os._exit(1)


def peak_bytes() -> int:
    """Peak resident memory of this process [bytes].

    Read from /proc where it exists, because getrusage includes the parent's memory at the time of the fork.
    """
    if _PROCESS_STATUS.is_file():
        rows = (line.split() for line in _PROCESS_STATUS.read_text().splitlines() if line.startswith("VmHWM:"))
        return next((int(words[1]) * 1024 for words in rows), 0)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


if __name__ == "__main__":
    main(int(sys.argv[1]))
