"""Writes a drive so that a frame is there whole or not at all, and a run can go on where it stopped."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import hashlib
import json
import os
import socket
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

import yaml

from assets.documents import parse_json
from cosim.drives.lock import LOCK, exclusive
from cosim.errors import CosimError

MANIFEST = "manifest.jsonl"
SUMMARY = "drive.yaml"
UNFINISHED = ".unfinished.yaml"
_TEMPORARY_SUFFIX = ".partial"
_HOST = "".join(filter(str.isalnum, socket.gethostname()))[:40]  # two machines may share a folder and a process id


class OutputError(CosimError):
    """The output folder cannot be used."""


@contextlib.contextmanager
def explained(path: Path) -> Iterator[None]:
    """Turn the operating system's refusals to write into one line with a remedy."""
    try:
        yield
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise OutputError(
                f"no space left to write {path}; free some and run the same command again: finished frames are kept"
            ) from error
        raise OutputError(f"cannot write {path}: {error.strerror}; choose another --out") from error


class DriveWriter:
    """One output folder. Any number of processes may write frames of it at the same time.

    Args:
        folder: the drive.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """Make the folder if need be, and keep other runs out of it.

        Raises:
            OutputError: it cannot be written.
            LockError: another run writes it.
        """
        with contextlib.ExitStack() as stack:
            with explained(self.folder):
                self.folder.mkdir(parents=True, exist_ok=True)
                stack.enter_context(exclusive(self.folder))
            yield

    def open(self, settings: str) -> bool:
        """Prepare the folder, or continue an interrupted run.

        Args:
            settings: text of the run's effective configuration; a run only goes on with the same.

        Returns:
            Whether the drive is finished already.

        Raises:
            OutputError: the folder holds something else, or cannot be written.
        """
        with explained(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
            contents = {item.name for item in self.folder.iterdir()} - {LOCK}
        for name in (UNFINISHED, SUMMARY):
            if name in contents:
                self._demand_same(name, settings)
                break
        else:
            # An unfinished marker that was itself interrupted is all such a folder can hold.
            if any(not name.endswith(_TEMPORARY_SUFFIX) for name in contents):
                raise OutputError(f"{self.folder} is not empty and holds no drive; choose another --out or empty it")
            self.write(UNFINISHED, settings.encode())
        if SUMMARY in contents:
            self._remove(UNFINISHED)
            return True
        self._clear_partial()
        self._cut_torn_line()
        return False

    def _demand_same(self, name: str, settings: str) -> None:
        with explained(self.folder / name):
            before = (self.folder / name).read_text(encoding="utf-8", errors="replace").splitlines()
        # A finished drive's summary starts with its settings.
        changed = [line for line, old in zip(settings.splitlines(), before, strict=False) if line != old]
        if changed or len(before) < len(settings.splitlines()):
            old = before[settings.splitlines().index(changed[0])] if changed else "fewer settings"
            raise OutputError(
                f"{self.folder} holds a drive made with other settings ({old.strip()!r}, now "
                f"{(changed or ['more'])[0].strip()!r}); choose another --out, or remove the folder"
            )

    def write(self, name: str, data: bytes) -> None:
        """Put one file in place whole: temporary name, fsync, rename.

        Raises:
            OutputError: it cannot be written; nothing half-written stays.
        """
        self._write_all({name: data})

    def _write_all(self, files: Mapping[str, bytes]) -> None:
        """Write all files under temporary names, then fsync all, then rename all.

        A journaling file system stores all of them at the first fsync, so that the others return at once.
        """
        partials: dict[Path, Path] = {}
        try:
            with contextlib.ExitStack() as opened:
                handles: dict[Path, BinaryIO] = {}
                for name, data in files.items():
                    path = self.folder / name
                    with explained(path):
                        path.parent.mkdir(parents=True, exist_ok=True)
                        partials[path] = partial_of(path)
                        handles[path] = opened.enter_context(partials[path].open("wb"))
                        handles[path].write(data)
                        handles[path].flush()
                for path, file in handles.items():
                    with explained(path):
                        os.fsync(file.fileno())
            for path, partial in partials.items():
                with explained(path):
                    partial.rename(path)
        except OutputError:
            for partial in partials.values():
                with contextlib.suppress(OSError):
                    partial.unlink(missing_ok=True)
            raise

    def write_once(self, name: str, data: bytes) -> None:
        """Like `write`, unless the file is there already."""
        if not (self.folder / name).is_file():
            self.write(name, data)

    def has(self, name: str) -> bool:
        """Whether a file is in place."""
        return (self.folder / name).is_file()

    def write_frame(
        self, name: str, files: Mapping[str, bytes], counts: Mapping[str, int], **about: str | float
    ) -> None:
        """Put all files of a frame in place, then list it in the manifest with `about` it."""
        self._write_all(files)
        entry = {
            "name": name,
            **about,
            "counts": dict(counts),
            "files": list(files),
            "sha256": [hashlib.sha256(data).hexdigest() for data in files.values()],
        }
        self._append_to(self.folder / MANIFEST, json.dumps(entry, separators=(",", ":")) + "\n")

    def write_note(self, entry: Mapping[str, object]) -> None:
        """Add a remark about an episode (`episode` and `attempt` name it) to the manifest."""
        self._append_to(self.folder / MANIFEST, json.dumps(entry, separators=(",", ":")) + "\n")

    def manifest(self) -> dict[str, dict]:
        """Finished frames by name."""
        return {entry["name"]: entry for entry in self.entries() if "name" in entry}

    def notes(self) -> dict[tuple[int, int], dict]:
        """Remarks by episode and attempt."""
        return {(entry["episode"], entry["attempt"]): entry for entry in self.entries() if "name" not in entry}

    def _cut_torn_line(self) -> None:
        """Shorten the manifest by a last line that an interruption tore."""
        path = self.folder / MANIFEST
        if path.is_file():
            with explained(path):
                data = path.read_bytes()
                whole = data[: data.rfind(b"\n") + 1]
                if len(whole) < len(data):
                    self.write(MANIFEST, whole)

    def entries(self) -> list[dict]:
        """Entries of the manifest, frames and remarks, without an incomplete last line.

        Raises:
            OutputError: a line is damaged.
        """
        path = self.folder / MANIFEST
        if not path.is_file():
            return []
        with explained(path):
            data = path.read_bytes()
            whole = data[: data.rfind(b"\n") + 1]
        entries = []
        for number, line in enumerate(whole.decode("utf-8", errors="replace").splitlines(), start=1):
            try:
                entry = parse_json(line)
                if not isinstance(entry.get("name", ""), str) or not ("name" in entry or "attempt" in entry):
                    raise ValueError
            except (ValueError, AttributeError):
                raise OutputError(f"{path}:{number} is damaged; remove that line to make its frame again") from None
            entries.append(entry)
        return entries

    def finish(self, files: Mapping[str, bytes], summary: str) -> None:
        """Sort the manifest and write what describes the whole drive, the summary last.

        Partial files of killed processes are removed: no process writes frames any more.
        """
        self._clear_partial()
        frames, notes = self.manifest(), self.notes()
        entries = [*(frames[name] for name in sorted(frames)), *(notes[key] for key in sorted(notes))]
        self.write(MANIFEST, _as_lines(entries))
        for path, data in files.items():
            self.write(path, data)
        self.write(SUMMARY, (summary + self._checksums(entries)).encode())
        self._remove(UNFINISHED)

    def reopen(self, without: Collection[str]) -> None:
        """Mark some frames of a finished drive as missing, so that their episodes are simulated again."""
        with explained(self.folder):
            if (self.folder / SUMMARY).is_file():
                (self.folder / SUMMARY).rename(self.folder / UNFINISHED)
        entries = self.entries()
        anew = {entry["episode"] for entry in entries if entry.get("name") in without}
        kept = [
            entry
            for entry in entries
            if (entry["name"] not in without if "name" in entry else entry["episode"] not in anew)
        ]
        self.write(MANIFEST, _as_lines(kept))

    def _checksums(self, entries: list[dict]) -> str:
        """Entries of the summary for files that do not belong to a single frame."""
        listed = {MANIFEST, SUMMARY, UNFINISHED, LOCK}.union(*(entry.get("files", ()) for entry in entries))
        with explained(self.folder):
            files = sorted(path for path in self.folder.rglob("*") if path.is_file())
            names = {path.relative_to(self.folder).as_posix(): path for path in files}
            sums = {name: sha256_of(path) for name, path in names.items() if name not in listed}
        return yaml.safe_dump({"sha256": sums}, sort_keys=False)

    def _append_to(self, path: Path, line: str) -> None:
        """Add a line whole or not at all, also when other processes do."""
        with explained(path), path.open("ab", buffering=0) as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            start = file.seek(0, os.SEEK_END)
            try:
                file.write(line.encode())
                os.fsync(file.fileno())
            except OSError:
                with contextlib.suppress(OSError):
                    file.truncate(start)
                raise

    def _remove(self, name: str) -> None:
        with explained(self.folder / name):
            (self.folder / name).unlink(missing_ok=True)

    def _clear_partial(self) -> None:
        with explained(self.folder):
            for path in self.folder.rglob(f".*{_TEMPORARY_SUFFIX}"):
                path.unlink(missing_ok=True)


def partial_of(path: Path) -> Path:
    """Temporary name of a file while this process writes it; remaining files of this kind are deleted."""
    return path.with_name(f".{path.name}.{_HOST}-{os.getpid()}{_TEMPORARY_SUFFIX}")


def sha256_of(path: Path) -> str:
    """Checksum of a file, as hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _as_lines(entries: Iterable[Mapping]) -> bytes:
    return "".join(json.dumps(entry, separators=(",", ":")) + "\n" for entry in entries).encode()
