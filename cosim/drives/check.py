"""Integrity check of a drive's files, and repair of damaged frames."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from pydantic import ValidationError

from cosim.capture.config import RunConfig
from cosim.capture.runner import run
from cosim.drives.files import is_safe_path, read_mapping
from cosim.drives.twin import read_frame
from cosim.drives.writer import MANIFEST, SUMMARY, UNFINISHED, DriveWriter, OutputError, sha256_of
from cosim.engine import Engine, JobEvent
from cosim.errors import CosimError
from sensors.pattern import first_problem


class CheckError(CosimError):
    """A drive cannot be checked, or not be repaired."""


@dataclass(frozen=True)
class CheckResult:
    """Result of a check.

    Attributes:
        folder: the drive.
        files: how many were checked.
        damaged: files that are `missing` or `changed`, by path.
        frames: frames that need them.
    """

    folder: Path
    files: int
    damaged: Mapping[str, str]
    frames: tuple[str, ...]


def check_drive(
    folder: Path,
    on_start: Callable[[int], None] = lambda files: None,
    on_file: Callable[[], None] = lambda: None,
) -> CheckResult:
    """Compare every file of a drive with the checksum it was written with.

    Args:
        folder: the drive.
        on_start: called with the number of files.
        on_file: called after each.

    Raises:
        CheckError: the folder has no checksums.
        CosimError: its manifest or summary is damaged.
    """
    if not (folder / MANIFEST).is_file():
        raise CheckError(f"{folder} has no {MANIFEST}: there are no checksums to hold its files against")
    manifest = DriveWriter(folder).manifest()
    of_frames = {name: _sums(folder, entry) for name, entry in manifest.items()}
    shared = _shared_sums(folder)
    expected = {path: sum_ for sums in of_frames.values() for path, sum_ in sums.items()} | shared
    on_start(len(expected))
    damaged: dict[str, str] = {}
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        states = threads.map(lambda item: _state(folder / item[0], item[1]), expected.items())
        for path, state in zip(expected, states, strict=True):
            on_file()
            if state is not None:
                damaged[path] = state
    frames = {name for name, sums in of_frames.items() if not damaged.keys().isdisjoint(sums)}
    frames |= _dependents(folder, sorted(of_frames), [path for path in shared if path in damaged], damaged)
    return CheckResult(folder, len(expected), damaged, tuple(sorted(frames)))


def repair_drive(
    result: CheckResult,
    *,
    engine: Engine | None = None,
    on_start: Callable[[int, int], None] = lambda done, total: None,
    on_event: Callable[[JobEvent], None] = lambda event: None,
) -> None:
    """Record only the damaged frames of a simulated drive again.

    Args:
        result: what is damaged.
        engine: whose processes record, as for `run`.
        on_start: called with the numbers of intact frames and of all frames.
        on_event: called with every event of the workers.

    Raises:
        CheckError: the drive was not recorded by `cosim run`, or comes out differently now.
        CosimError: recording fails; what is whole stays.
    """
    if not result.damaged:
        return
    folder, writer = result.folder, DriveWriter(result.folder)
    config = _config_of(folder)
    before = writer.manifest()
    with writer.alone():
        writer.reopen(result.frames)
        for path in result.damaged:
            (folder / path).unlink(missing_ok=True)
    run(config, folder, engine=engine, on_start=on_start, on_event=on_event)
    after = writer.manifest()
    other = [name for name in result.frames if after.get(name, {}).get("sha256") != before[name]["sha256"]]
    if other:
        raise CheckError(
            f"{len(other)} frames came out differently from before, {other[0]} first; keep either drive whole"
        )


def _sums(folder: Path, entry: Mapping) -> dict[str, str]:
    files, sums = entry.get("files"), entry.get("sha256")
    if not (isinstance(files, list) and isinstance(sums, list) and len(files) == len(sums)):
        raise OutputError(f"{folder / MANIFEST}: frame {entry['name']} has no files or checksums; remove its line")
    return dict(zip(_safe(files, folder / MANIFEST), map(str, sums), strict=True))


def _shared_sums(folder: Path) -> dict[str, str]:
    """Checksums of what belongs to no single frame; none of a drive that is unfinished."""
    if not (folder / SUMMARY).is_file():
        return {}
    summary = read_mapping(folder / SUMMARY)
    sums = summary.get("sha256", {}) if summary else None
    if not isinstance(sums, dict):
        raise OutputError(f"{folder / SUMMARY} is damaged: sha256 must hold a checksum by file")
    return dict(zip(_safe(sums, folder / SUMMARY), map(str, sums.values()), strict=True))


def _safe(paths: Iterable[object], where: Path) -> list[str]:
    names = [str(path) for path in paths]
    for name in names:
        if not is_safe_path(name):
            raise OutputError(f"{where}: {name!r} is no path within the drive; the file is damaged, or a trap")
    return names


def _state(path: Path, checksum: str) -> str | None:
    try:
        return None if sha256_of(path) == checksum else "changed"
    except FileNotFoundError:
        return "missing"
    except OSError as error:
        raise OutputError(f"cannot read {path}: {error.strerror}") from error


def _dependents(folder: Path, names: list[str], paths: list[str], damaged: Mapping[str, str]) -> set[str]:
    """For each damaged file that frames share, one frame whose recording makes it again."""
    wanted = set(paths)
    found: set[str] = set()
    for name in names if wanted else ():
        file = f"twin/frames/{name}.json"
        if file in damaged or not wanted:
            continue
        twin = read_frame(folder / file)
        makes = {f"twin/models/{instance.model}.glb" for instance in twin.instances}
        makes |= {f"twin/{twin.static or 'static.glb'}", "twin/materials.yaml"}
        if wanted & makes:
            found.add(name)
            wanted -= makes
    return found


def _config_of(folder: Path) -> RunConfig:
    for name in (SUMMARY, UNFINISHED):
        if (folder / name).is_file():
            summary = read_mapping(folder / name)
            if "variant" in summary:
                raise CheckError(f"{folder} is a variant: remove it and make it again with cosim variants")
            if "config" in summary:
                try:
                    return RunConfig.model_validate(summary["config"])
                except ValidationError as error:
                    raise CheckError(f"{folder / name} is damaged: {first_problem(error)}") from error
    raise CheckError(f"{folder} was not recorded by cosim run, so its frames cannot be made again")
