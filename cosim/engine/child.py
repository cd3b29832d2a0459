"""A process that does tasks one after the other: `python -m cosim.engine.child FD`, its end of a socket."""

from __future__ import annotations

import gc
import os
import queue
import signal
import sys
import threading
import traceback
from multiprocessing.connection import Connection

from cosim.engine.jobs import Event, Job
from cosim.engine.peak import peak_bytes
from cosim.user_errors import user_errors

_COLLECTS = (50_000, 20, 50)  # the garbage of a step is freed at once; cycles are rare


def main(descriptor: int) -> None:
    """Do what comes through the socket until None comes, or until nobody is at its other end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent hears it too, and decides
    connection = Connection(descriptor)
    job, threads = connection.recv()
    tasks: queue.SimpleQueue = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(connection, tasks), daemon=True).start()
    tell = _Teller(connection)
    try:
        _do_all(job, threads, tasks, tell)
    except user_errors() as error:
        tell(Event("refused", str(error)))
    except Exception:  # noqa: BLE001 — whatever it is, the parent must hear of it
        tell(Event("failed", traceback.format_exc()))


def _do_all(job: Job, threads: int, tasks: queue.SimpleQueue, tell: _Teller) -> None:
    with job.open(threads) as do:
        tell(Event("opened"))
        gc.freeze()  # what a job holds on to need not be looked through again and again
        gc.set_threshold(*_COLLECTS)
        while (task := tasks.get()) is not None:
            do(task, tell)
            tell(Event("task", peak_bytes=peak_bytes()))


def _listen(connection: Connection, tasks: queue.SimpleQueue) -> None:
    """Hand tasks on; end the process with whoever gives them, so that nobody writes on behind a dead one's back."""
    try:
        while True:
            task = connection.recv()
            tasks.put(task)
            if task is None:
                return
    except (EOFError, OSError):
        os._exit(1)


class _Teller:
    """Sends events, from any thread."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._lock = threading.Lock()

    def __call__(self, event: Event) -> None:
        try:
            with self._lock:
                self._connection.send(event)
        except OSError:
            os._exit(1)


if __name__ == "__main__":
    main(int(sys.argv[1]))
