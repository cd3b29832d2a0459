"""What costs seconds to make is made once a test run, however many processes run the tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from filelock import FileLock


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object]) -> Path:
    """A folder that one of the test processes fills and all read; its contents must not be changed.

    Args:
        factory: pytest's; its base is a process's own, and the folder above it that of the whole run.
        name: of the folder.
        make: is given the folder, which exists and is empty unless an earlier attempt failed.
    """
    base = factory.getbasetemp()
    whole_run = base.parent if base.name.startswith("popen-") else base
    folder, done = whole_run / "shared" / name, whole_run / "shared" / f"{name}.done"
    folder.mkdir(parents=True, exist_ok=True)
    with FileLock(whole_run / f"{name}.lock"):
        if not done.exists():
            make(folder)
            done.touch()
    return folder


class _ThisProcess:
    """An engine without processes of its own, which would each take seconds to start."""

    def share_out(
        self,
        job: Any,
        tasks: Sequence[Any],
        on_event: Callable[[Any], None],
        *,
        refresh_task: Callable[[Any], Any] = lambda task: task,
    ) -> list[Any]:
        from cosim.engine import JobEvent

        with job.open(1) as do:
            for task in tasks:
                do(task, on_event)
                on_event(JobEvent("task"))
        return []


def record(config: Path | None, folder: Path, **changes: Any) -> Path:
    """A drive, recorded by the process that tests; gives its folder.

    Args:
        config: the configuration's file; none for the defaults.
        folder: of the drive.
        changes: settings that win over the file's.
    """
    from cosim.capture.config import load_config
    from cosim.capture.runner import run

    return run(load_config(config, **changes), folder, engine=_ThisProcess()).folder
