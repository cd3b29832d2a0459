"""Work shared out among spawned processes that tell what happens."""

from __future__ import annotations

import multiprocessing
import os
import queue
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from typing import Any, Literal

from cosim.errors import CosimError
from cosim.user_errors import USER_ERRORS

_POLL_S = 0.5
_PATIENCE_S = 10.0
# Matrix products here are too small for BLAS to gain by threads; on busy cores it loses much.
_WITHOUT_BLAS_THREADS = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


class WorkError(CosimError):
    """Work could not go on."""


@dataclass(frozen=True)
class Event:
    """What a worker tells.

    Attributes:
        kind: `ready` (the town is built), `frame` (one is on disk), `task` (one is complete), `refused` (the
            user's mistake, in `text`) or `failed` (ours: `text` is a traceback).
        text: frame name or message.
    """

    kind: Literal["ready", "frame", "task", "refused", "failed"]
    text: str = ""


def share_out(
    work: Callable[..., None],
    arguments: tuple[Any, ...],
    tasks: Sequence[Any],
    workers: int,
    on_event: Callable[[Event], None],
) -> None:
    """Have processes work on all tasks, and pass on what they tell; they are ended whatever happens.

    Args:
        work: called in each process as `work(*arguments, tasks, events, threads)`, with a queue of tasks that ends
            in None, the queue for its events, and how many threads it may use. Tells `task` once a task.
        arguments: what each process is given.
        tasks: what there is to do.
        workers: most processes.
        on_event: told of every event.

    Raises:
        WorkError: a worker met a user's mistake, or died.
    """
    with _started(work, arguments, tasks, min(workers, len(tasks))) as (processes, events):
        _follow(processes, events, len(tasks), on_event)


@contextmanager
def telling(events: Any) -> Iterator[None]:
    """Tell the parent of errors, and end with it, however it ends, so that nobody writes on behind its back."""
    _end_with_parent()
    try:
        yield
    except USER_ERRORS as error:
        events.put(Event("refused", str(error)))
    except Exception:  # noqa: BLE001 — whatever it is, the parent must hear of it
        events.put(Event("failed", traceback.format_exc()))


@contextmanager
def _started(
    work: Callable[..., None], arguments: tuple[Any, ...], tasks: Sequence[Any], count: int
) -> Iterator[tuple[list[BaseProcess], Any]]:
    context = multiprocessing.get_context("spawn")
    queued, events = context.Queue(), context.Queue()
    threads = max(1, (os.cpu_count() or 1) // max(count, 1))
    environment = {**_WITHOUT_BLAS_THREADS, "LP_NUM_THREADS": str(threads if threads > 1 else 0)}
    for task in [*tasks, *[None] * count]:
        queued.put(task)
    processes: list[BaseProcess] = [
        context.Process(target=work, args=(*arguments, queued, events, threads), daemon=True) for _ in range(count)
    ]
    before = {name: os.environ.get(name) for name in environment}
    os.environ.update(environment)
    try:
        for process in processes:
            process.start()
        yield processes, events
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
        for process in processes:
            process.join(0.0 if process.exitcode is None else None)
            if process.is_alive():
                process.terminate()
                process.join(_PATIENCE_S)
        queued.cancel_join_thread()
        events.cancel_join_thread()


def _follow(processes: list[BaseProcess], events: Any, tasks: int, on_event: Callable[[Event], None]) -> None:
    """Pass events on until all tasks are complete."""
    while tasks:
        try:
            event: Event = events.get(timeout=_POLL_S)
        except queue.Empty:
            dead = [process for process in processes if process.exitcode not in (None, 0)]
            if dead:
                raise WorkError(
                    f"a worker process died (exit code {dead[0].exitcode}, often too little memory); "
                    "run the same command again to go on"
                ) from None
            continue
        if event.kind == "refused":
            raise WorkError(event.text)
        if event.kind == "failed":
            raise RuntimeError(f"a worker failed:\n{event.text}")
        on_event(event)
        tasks -= event.kind == "task"
    for process in processes:
        process.join(_PATIENCE_S)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()

    def wait() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
