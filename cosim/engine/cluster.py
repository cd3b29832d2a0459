"""Engine that runs tasks on a Dask cluster, in child processes of the Dask workers.

A child may crash, hang or be killed without affecting its Dask worker. If a worker dies, its children exit and the
scheduler assigns their tasks to another worker. Files on disk remain complete in both cases. Tasks with the same
affinity are submitted in groups, because a child that executes them one after the other builds their world only once.
"""

from __future__ import annotations

import logging
import os
import queue
import re
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from typing import TYPE_CHECKING, Any, Literal

from cosim.engine.jobs import Job, JobEvent, Skipped, Tell, WorkError, affinity_of, with_next
from cosim.engine.local import PATIENCE_S
from cosim.engine.parent import Child
from cosim.engine.retries import Attempt, Retries

if TYPE_CHECKING:
    from distributed import Client, Future

_ADDRESS = re.compile(r"(tcp|tls)://[^\s/]+:\d+")
_CONNECT_S = 20.0
_POLL_S = 0.2
_LARGEST_GROUP = 4  # tasks; larger groups would make the workers wait for the last one at the end of a run
_GROUPS_PER_THREAD = 4
_EXPECTED_THREADS = 64  # if no worker has joined yet
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class DaskEngine:
    """Distributes tasks to the workers of a Dask scheduler; all of them must have the same files at the same paths.

    Attributes:
        address: address of the scheduler, `tcp://HOST:PORT`.
        patience_s: time without an event after which a process is stopped [s].
    """

    address: str
    patience_s: float = PATIENCE_S

    def share_out(
        self, job: Job, tasks: Sequence[Any], on_event: Tell, *, refresh_task: Callable[[Any], Any] = lambda task: task
    ) -> list[Skipped]:
        """Execute all tasks; see `Engine.share_out`. Workers may join and leave during the run.

        Raises:
            WorkError: a worker reported an error of the user, no scheduler answers, the connection to it is lost, or
                Dask is not installed.
        """
        name = f"cosim-{uuid.uuid4().hex}"
        events: queue.SimpleQueue[JobEvent] = queue.SimpleQueue()
        with _connect(self.address) as client:
            client.subscribe_topic(name, lambda message: events.put(JobEvent(*message[1])))
            client.register_plugin(_make_plugin(job, self.patience_s), name=name)
            if not client.nthreads():
                _log.warning("no worker has joined %s yet; waiting for one", self.address)
            retries = Retries(on_event, refresh_task)
            try:
                _Submissions(client, self.address, name, on_event).run(tasks, events, retries)
            finally:
                if client.status == "running":
                    client.unregister_worker_plugin(name)
        return retries.skipped


class _Submissions:
    """Groups of tasks submitted to the cluster."""

    def __init__(self, client: Client, address: str, name: str, on_event: Tell) -> None:
        self._client, self._address, self._name, self._on_event = client, address, name, on_event
        self._pending: dict[Future, list[Attempt]] = {}
        self._count = 0

    def run(self, tasks: Sequence[Any], events: queue.SimpleQueue[JobEvent], retries: Retries) -> None:
        workers: Any = self._client.nthreads()
        threads = sum(workers.values()) or _EXPECTED_THREADS
        for group in _group(tasks, len(tasks) // (threads * _GROUPS_PER_THREAD)):
            self._submit([Attempt(task) for task in group])
        while self._pending:
            self._forward(events)
            for future in [future for future in self._pending if future.done()]:
                self._settle(future, self._pending.pop(future), retries)

    def _submit(self, attempts: list[Attempt]) -> None:
        # Earlier tasks first: neighbouring tasks have the same affinity.
        key = f"{self._name}-{self._count}"
        self._count += 1
        tasks = [attempt.task for attempt in attempts]
        future = self._client.submit(_run_tasks, tasks, self._name, key=key, pure=False, priority=-self._count)
        self._pending[future] = attempts

    def _forward(self, events: queue.SimpleQueue[JobEvent]) -> None:
        try:
            self._on_event(events.get(timeout=_POLL_S))
            while True:
                self._on_event(events.get_nowait())
        except queue.Empty:
            pass

    def _settle(self, future: Future, attempts: list[Attempt], retries: Retries) -> None:
        """Report the finished tasks of a group; submit those again that failed or were not reached."""
        if self._client.status != "running":
            raise WorkError(
                f"the connection to the Dask scheduler at {self._address} is lost; start it again, then the same "
                "command resumes the run"
            )
        if future.status != "finished" and len(attempts) > 1:
            for attempt in attempts:  # one by one, because it is not known which one failed
                self._submit([attempt])
            return
        outcomes = [_failure_of(future)] if future.status != "finished" else future.result()
        for attempt, outcome in zip(attempts, outcomes, strict=False):  # of those that were reached
            if outcome.kind == "refused":
                raise WorkError(outcome.text)
            if outcome.kind == "done":
                self._on_event(JobEvent("task", peak_bytes=outcome.peak_bytes))
            elif retry := retries.next_attempt(attempt, outcome.text):
                self._submit([retry])
        if len(outcomes) < len(attempts):
            self._submit(attempts[len(outcomes) :])


def _group(tasks: Sequence[Any], size: int) -> list[list[Any]]:
    """Divide tasks into groups of neighbours with the same affinity, of at most a size (at least 1)."""
    groups: list[list[Any]] = []
    for task in tasks:
        if (
            groups
            and len(groups[-1]) < min(size, _LARGEST_GROUP)
            and affinity_of(groups[-1][0]) == affinity_of(task) != ()
        ):
            groups[-1].append(task)
        else:
            groups.append([task])
    return groups


@dataclass(frozen=True)
class _Outcome:
    kind: Literal["done", "refused", "failed"]
    text: str = ""
    peak_bytes: int = 0


def _failure_of(future: Future) -> _Outcome:
    """Outcome of a task whose worker did not return one."""
    is_error = future.status == "error"
    return _Outcome("failed", " ".join(str(future.exception()).split()) if is_error else "it was cancelled")


@dataclass
class _ChildPool:
    """Idle children of a Dask worker."""

    job: Job
    patience_s: float
    folder: str
    idle: list[Child] = field(default_factory=list)

    def run_tasks(self, tasks: Sequence[Any], tell: Tell) -> list[_Outcome]:
        """Execute tasks in one child until one fails; returns the outcomes of those that were started."""
        child = self.idle.pop() if self.idle else Child(self.job, 1, folder=self.folder)
        outcomes: list[_Outcome] = []
        try:
            for number, task in enumerate(tasks, start=1):
                child.send_task(with_next(task, tasks[number]) if number < len(tasks) else task)
                outcomes.append(self._wait_for(child, tell))
                if outcomes[-1].kind != "done":
                    child.kill()
                    return outcomes
        except BaseException:
            child.kill()
            raise
        self.idle.append(child)
        return outcomes

    def shut_down(self) -> None:
        while self.idle:
            self.idle.pop().shut_down()

    def _wait_for(self, child: Child, tell: Tell) -> _Outcome:
        while True:
            if not wait([child.connection], timeout=_POLL_S):
                if child.is_hanging(self.patience_s):
                    return _Outcome("failed", f"its process did not report for {self.patience_s:g} s")
                continue
            event = child.receive()
            if event is None:
                return _Outcome("failed", child.exit_reason())
            if event.kind == "task":
                return _Outcome("done", peak_bytes=event.peak_bytes)
            if event.kind == "refused":
                return _Outcome("refused", event.text)
            if event.kind == "failed":
                return _Outcome("failed", event.text.strip().splitlines()[-1])
            if event.kind != "alive":  # only needed locally, to detect processes that hang
                tell(event)


def _make_plugin(job: Job, patience_s: float) -> Any:
    """Dask plugin that keeps a pool of children on every worker, including workers that join later."""
    from distributed import WorkerPlugin

    class Plugin(WorkerPlugin):
        def __init__(self, folder: str) -> None:
            self.folder = folder

        def setup(self, worker: Any) -> None:
            self.pool = _ChildPool(job, patience_s, self.folder)

        def teardown(self, worker: Any) -> None:
            self.pool.shut_down()

    return Plugin(os.getcwd())  # noqa: PTH109 — a plain string is pickled


def _run_tasks(tasks: Sequence[Any], name: str) -> list[_Outcome]:
    """Execute a group of tasks on a Dask worker."""
    from distributed import get_worker

    worker = get_worker()
    plugin: Any = worker.plugins[name]

    def tell(event: JobEvent) -> None:
        worker.log_event(name, (event.kind, event.text, event.peak_bytes))

    return plugin.pool.run_tasks(tasks, tell)


@contextmanager
def _connect(address: str) -> Iterator[Client]:
    if not _ADDRESS.fullmatch(address):
        raise WorkError(f"{address!r} is not the address of a Dask scheduler; give tcp://HOST:PORT")
    try:
        from distributed import Client
    except ImportError:
        raise WorkError("Dask is not installed; run: pip install 'cosim[cluster]'") from None
    try:
        client = Client(address, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise WorkError(f"no Dask scheduler answers at {address} ({error}); start one: dask scheduler") from error
    with client:
        yield client
