"""Keeps two runs out of one folder, however the first one ended.

A file is locked as long as the run or any of its processes lives, on whichever machine of a shared file system; the
operating system lifts the lock of a process that dies.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from cosim.errors import CosimError

LOCK = ".lock"
_HOLDER = "process {pid} on {host}"
_WAIT_S = 5.0
_WAIT_FOR_ORPHANS_S = 60.0  # processes of a run that was killed end within this, however busy the machine
_POLL_S = 0.05


class LockError(CosimError):
    """Someone else is at work in the folder."""


@contextlib.contextmanager
def exclusive(folder: Path) -> Iterator[None]:
    """Be the one run that writes a folder; its processes join with `shared`.

    Raises:
        LockError: another run writes it.
        OSError: the lock's file cannot be written.
    """
    with _taken(folder) as file:
        # From here on others may share it, but no process can lock it exclusively.
        fcntl.flock(file, fcntl.LOCK_SH)
        try:
            yield
        finally:
            with contextlib.suppress(OSError):
                (folder / LOCK).unlink(missing_ok=True)


@contextlib.contextmanager
def shared(folder: Path) -> Iterator[None]:
    """Write a folder on behalf of the run that has it."""
    with (folder / LOCK).open("a") as file:
        fcntl.flock(file, fcntl.LOCK_SH)
        yield


@contextlib.contextmanager
def _taken(folder: Path) -> Iterator[IO[str]]:
    started = time.monotonic()
    while True:
        with (folder / LOCK).open("a+") as file:
            if _locked(file, folder / LOCK):
                file.truncate(0)
                file.write(_HOLDER.format(pid=os.getpid(), host=socket.gethostname()))
                file.flush()
                yield file
                return
            file.seek(0)
            holder = file.read(200) or "a process"
            if time.monotonic() - started > (_WAIT_FOR_ORPHANS_S if _is_dead(holder) else _WAIT_S):
                raise LockError(
                    f"{folder} is being written by another run ({holder}); wait for it, or choose another --out"
                )
        time.sleep(_POLL_S)


def _locked(file: IO[str], path: Path) -> bool:
    """Lock a file exclusively, unless another process has it, or it was removed meanwhile."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    try:
        return os.fstat(file.fileno()).st_ino == path.stat().st_ino
    except FileNotFoundError:
        return False


def _is_dead(holder: str) -> bool:
    """Whether a run of this machine has ended, so that only its processes may still be about to."""
    match = re.fullmatch(_HOLDER.format(pid=r"(\d{1,9})", host=re.escape(socket.gethostname())), holder)
    if match is None:
        return False
    try:
        os.kill(int(match[1]), 0)
    except ProcessLookupError:
        return True
    except PermissionError:  # it lives, under another user
        pass
    return False
