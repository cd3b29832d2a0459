"""Processes of a Dask cluster: each of its workers starts children of its own, as a single machine does.

A child of a Dask worker may crash, hang or be killed without the worker; a worker that dies takes its children along,
and the scheduler gives their tasks to another. Both leave what is on disk whole.
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

from cosim.engine.jobs import Event, Job, Skipped, Tell, WorkError
from cosim.engine.local import PATIENCE_S
from cosim.engine.parent import Child
from cosim.engine.retries import Attempt, Retries

if TYPE_CHECKING:
    from distributed import Client, Future

_ADDRESS = re.compile(r"(tcp|tls)://[^\s/]+:\d+")
_CONNECT_S = 20.0
_POLL_S = 0.2
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class DaskEngine:
    """Shares tasks among the workers of a Dask scheduler; all must see the same files under the same paths.

    Attributes:
        address: of the scheduler, `tcp://HOST:PORT`.
        patience_s: a process that tells nothing for so long is ended [s].
    """

    address: str
    patience_s: float = PATIENCE_S

    def share_out(
        self, job: Job, tasks: Sequence[Any], on_event: Tell, *, renewed: Callable[[Any], Any] = lambda task: task
    ) -> list[Skipped]:
        """Have all tasks done; see `Engine`. Workers may come and go meanwhile.

        Raises:
            WorkError: also where no scheduler answers, or Dask is not installed.
        """
        name = f"cosim-{uuid.uuid4().hex}"
        told: queue.SimpleQueue[Event] = queue.SimpleQueue()
        with _connected(self.address) as client:
            client.subscribe_topic(name, lambda message: told.put(Event(*message[1])))
            client.register_plugin(_plugin(job, self.patience_s), name=name)
            if not client.nthreads():
                _log.warning("no worker has joined %s yet; waiting for one", self.address)
            retries = Retries(on_event, renewed)
            try:
                _Submissions(client, name, on_event).follow(tasks, told, retries)
            finally:
                client.unregister_worker_plugin(name)
        return retries.skipped


class _Submissions:
    """What the cluster was given, and what comes back."""

    def __init__(self, client: Client, name: str, on_event: Tell) -> None:
        self._client, self._name, self._on_event = client, name, on_event
        self._pending: dict[Future, Attempt] = {}
        self._count = 0

    def follow(self, tasks: Sequence[Any], told: queue.SimpleQueue[Event], retries: Retries) -> None:
        for task in tasks:
            self._submit(Attempt(task))
        while self._pending:
            self._pass_on(told)
            for future in [future for future in self._pending if future.done()]:
                attempt = self._pending.pop(future)
                reason = self._settled(future)
                again = None if reason is None else retries.after(attempt, reason)
                if again is not None:
                    self._submit(again)

    def _submit(self, attempt: Attempt) -> None:
        # Earlier tasks first: those of one place follow each other.
        key = f"{self._name}-{self._count}"
        self._count += 1
        future = self._client.submit(_do, attempt.task, self._name, key=key, pure=False, priority=-self._count)
        self._pending[future] = attempt

    def _pass_on(self, told: queue.SimpleQueue[Event]) -> None:
        try:
            self._on_event(told.get(timeout=_POLL_S))
            while True:
                self._on_event(told.get_nowait())
        except queue.Empty:
            pass

    def _settled(self, future: Future) -> str | None:
        """Why its task failed, if so."""
        if future.status != "finished":
            return " ".join(str(future.exception()).split()) if future.status == "error" else "it was cancelled"
        outcome: _Outcome = future.result()
        if outcome.kind == "refused":
            raise WorkError(outcome.text)
        if outcome.kind == "failed":
            return outcome.text
        self._on_event(Event("task", peak_bytes=outcome.peak_bytes))
        return None


@dataclass(frozen=True)
class _Outcome:
    kind: Literal["done", "refused", "failed"]
    text: str = ""
    peak_bytes: int = 0


@dataclass
class _Bench:
    """Children of a Dask worker that wait for their next task."""

    job: Job
    patience_s: float
    folder: str
    idle: list[Child] = field(default_factory=list)

    def do(self, task: Any, tell: Tell) -> _Outcome:
        child = self.idle.pop() if self.idle else Child(self.job, 1, folder=self.folder)
        child.give(task)
        try:
            outcome = self._follow(child, tell)
        except BaseException:
            child.kill()
            raise
        if outcome.kind == "done":
            self.idle.append(child)
        else:
            child.kill()
        return outcome

    def dismiss(self) -> None:
        while self.idle:
            self.idle.pop().dismiss()

    def _follow(self, child: Child, tell: Tell) -> _Outcome:
        while True:
            if not wait([child.connection], timeout=_POLL_S):
                if child.hangs(self.patience_s):
                    return _Outcome("failed", f"its process told nothing for {self.patience_s:g} s")
                continue
            event = child.hear()
            if event is None:
                return _Outcome("failed", child.obituary())
            if event.kind == "task":
                return _Outcome("done", peak_bytes=event.peak_bytes)
            if event.kind == "refused":
                return _Outcome("refused", event.text)
            if event.kind == "failed":
                return _Outcome("failed", event.text.strip().splitlines()[-1])
            if event.kind != "alive":  # that is for this machine, not for the scheduler
                tell(event)


def _plugin(job: Job, patience_s: float) -> Any:
    """Keeps a bench on every worker, those that join later included."""
    from distributed import WorkerPlugin

    class Plugin(WorkerPlugin):
        def __init__(self, folder: str) -> None:
            self.folder = folder

        def setup(self, worker: Any) -> None:
            self.bench = _Bench(job, patience_s, self.folder)

        def teardown(self, worker: Any) -> None:
            self.bench.dismiss()

    return Plugin(os.getcwd())  # noqa: PTH109 — a plain string travels


def _do(task: Any, name: str) -> _Outcome:
    """One task, on a Dask worker."""
    from distributed import get_worker

    worker = get_worker()
    plugin: Any = worker.plugins[name]

    def tell(event: Event) -> None:
        worker.log_event(name, (event.kind, event.text, event.peak_bytes))

    return plugin.bench.do(task, tell)


@contextmanager
def _connected(address: str) -> Iterator[Client]:
    if not _ADDRESS.fullmatch(address):
        raise WorkError(f"{address!r} is no address of a Dask scheduler; give tcp://HOST:PORT")
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
