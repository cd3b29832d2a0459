"""A job whose tasks meet with what happens to real ones: their process dies, hangs, or runs into an error."""

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from cosim.engine import Do, JobEvent, Tell
from cosim.errors import CosimError


@dataclass(frozen=True)
class Task:
    name: str
    mishap: str = ""
    always: bool = False
    affinity: tuple[str, ...] = ()


@dataclass(frozen=True)
class Mishaps:
    """Writes a file for each started task, `NAME.PID`, and for each finished one, `NAME`."""

    folder: Path

    @contextmanager
    def open(self, threads: int) -> Iterator[Do]:
        (self.folder / f"opened.{os.getpid()}").touch()
        yield self._do

    def _do(self, task: Task, tell: Tell) -> None:
        first = not list(self.folder.glob(f"{task.name}.*"))
        (self.folder / f"{task.name}.{os.getpid()}").touch()
        if first or task.always:
            self._meet(task.mishap, tell)
        (self.folder / task.name).write_text(str(os.getpid()))
        tell(JobEvent("frame", task.name))

    def _meet(self, mishap: str, tell: Tell) -> None:
        match mishap:
            case "killed":
                os.kill(os.getpid(), signal.SIGKILL)
            case "stopped":
                os.kill(os.getpid(), signal.SIGSTOP)
            case "exits":
                os._exit(3)
            case "error":
                raise ZeroDivisionError("the road is of no length")
            case "refused":
                raise CosimError("speed is -3; give 0 or more")
            case "long":
                for _ in range(12):
                    time.sleep(0.25)
                    tell(JobEvent("alive"))
            case "slow":
                time.sleep(60)
