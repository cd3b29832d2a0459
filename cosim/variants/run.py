"""`cosim variants`: distribute the frames to processes, write them, finish the drives."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import yaml

from cosim.drives.lock import shared
from cosim.drives.writer import OutputError
from cosim.engine import Do, Engine, JobEvent, LocalEngine, Tell
from cosim.variants.maker import Maker
from cosim.variants.request import Variant, VariantError, read_variants
from cosim.variants.source import VariantSource
from cosim.variants.writer import VariantWriter

_TASK_FRAMES = 10  # frames per task; the frames of a world are consecutive, so that it is rarely rebuilt
_WRITERS = 3  # threads that write while the next frame is computed
_VERSIONS = ("cosim", "embreex", "numpy")

Task = list[tuple[str, tuple[str, ...]]]
"""Frames, each with the variants in which it is missing."""


@dataclass(frozen=True)
class VariantsResult:
    """Result of making variants.

    Attributes:
        folder: folder that contains one drive per variant.
        frames: number of frames of the source.
        made: number of variant frames made by this call; the others existed already.
        points: mean number of points per frame, by variant.
    """

    folder: Path
    frames: int
    made: int
    points: Mapping[str, float]


def make_variants(
    path: Path,
    text: str,
    folder: Path,
    *,
    engine: Engine | None = None,
    on_start: Callable[[int, int], None] = lambda done, total: None,
    on_event: Callable[[JobEvent], None] = lambda event: None,
) -> VariantsResult:
    """Simulate the scans of a drive again with other sensors, or resume an interrupted call.

    Args:
        path: folder of the source drive.
        text: list of variants in the format of `read_variants`.
        folder: output folder, one drive per variant.
        engine: engine that runs the tasks; by default one local process.
        on_start: called with the number of complete frames and the total number of frames.
        on_event: called with every event of the workers.

    Raises:
        CosimError: the drive or the folder is unsuitable, or the disk cannot be written; frames already written are
            kept.
        SensorError: a sensor does not exist or is invalid, or one of its effects returns invalid results.
    """
    source = VariantSource(path)
    variants = read_variants(text, source.annotator)
    _check_outside(source.drive.root, folder)
    writers = {variant.stem: VariantWriter(folder / variant.stem) for variant in variants}
    with ExitStack() as locks:
        for writer in writers.values():
            locks.enter_context(writer.alone())
        open_writers = {v.stem: writers[v.stem] for v in variants if not writers[v.stem].open(_settings(source, v))}
        done = {stem: frozenset(writer.manifest()) for stem, writer in open_writers.items()}
        missing = {name: tuple(stem for stem in done if name not in done[stem]) for name in source.drive.frames}
        missing = {name: stems for name, stems in missing.items() if stems}
        on_start(len(source.drive) - len(missing), len(source.drive))
        job = VariantsJob(path.absolute(), text, folder.absolute())
        skipped = (engine or LocalEngine()).share_out(job, _make_tasks(source, missing), on_event)
        if skipped:
            raise VariantError(f"some frames failed twice, because {skipped[0].reason}; run again to retry them")
        for variant in variants:
            if variant.stem in open_writers:
                _finish(open_writers[variant.stem], source, variant)
    return VariantsResult(
        folder,
        len(source.drive),
        sum(map(len, missing.values())),
        {v.stem: _mean_points(folder / v.stem) for v in variants},
    )


@dataclass(frozen=True)
class VariantsJob:
    """Source drive, variants and output folder of the processes."""

    path: Path
    text: str
    folder: Path

    @contextmanager
    def open(self, threads: int) -> Iterator[Do]:
        """Open the source; yields a function that makes the frames of a `Task`."""
        with ThreadPoolExecutor(_WRITERS) as disk, ExitStack() as locks:
            source = VariantSource(self.path, threads=threads)
            variants = read_variants(self.text, source.annotator)
            maker = Maker(source, variants)
            writers = {variant.stem: VariantWriter(self.folder / variant.stem) for variant in variants}
            for writer in writers.values():
                locks.enter_context(shared(writer.folder))

            def make(task: Task, tell: Tell) -> None:
                tell(JobEvent("ready"))
                writing: list[Future[None]] = []
                for name, stems in task:
                    frames, linked = maker.make(name, stems), source.linked_files(name)
                    _wait(writing, tell)
                    writing = [
                        disk.submit(writers[stem].write_variant, name, frame, linked, source.sha256)
                        for stem, frame in frames.items()
                    ]
                _wait(writing, tell)

            yield make


def _wait(writing: list[Future[None]], tell: Tell) -> None:
    """Wait until the variants of a frame are on disk, and report the frame."""
    for future in writing:
        future.result()
    if writing:
        tell(JobEvent("frame"))


def _make_tasks(source: VariantSource, missing: Mapping[str, tuple[str, ...]]) -> list[Task]:
    """Group the frames into tasks, each within one world."""
    by_world: dict[str, Task] = {}
    for name, stems in missing.items():
        by_world.setdefault(source.world(name), []).append((name, stems))
    return [
        frames[start : start + _TASK_FRAMES]
        for frames in by_world.values()
        for start in range(0, len(frames), _TASK_FRAMES)
    ]


def _check_outside(root: Path, folder: Path) -> None:
    output = folder.resolve()
    if output == root.resolve() or root.resolve() in output.parents:
        raise OutputError(f"{folder} is inside the drive {root}; choose another --out")


def _settings(source: VariantSource, variant: Variant) -> str:
    """YAML text of all settings that determine the bytes of a variant."""
    document = {
        "kind": "simulated",
        "variant": variant.stem,
        "of": source.identity,
        "pattern": variant.sensor.pattern.name,
        "sweep_s": variant.sensor.pattern.sweep_s,
        "seed": source.seed,
        "sensor": yaml.safe_load(variant.sensor.to_yaml()),
        "versions": {name: version(name) for name in _VERSIONS},
    }
    if "label_camera" in source.drive.info:
        document["label_camera"] = source.drive.info["label_camera"]
    return yaml.safe_dump(document, sort_keys=False)


def _finish(writer: VariantWriter, source: VariantSource, variant: Variant) -> None:
    for path, file in source.common_files().items():
        writer.share(path, file)
    counts = [entry["counts"] for entry in writer.manifest().values()]
    total = {key: sum(count[key] for count in counts) for key in counts[0]} | {"frames": len(counts)}
    files = {
        "pattern.yaml": variant.sensor.pattern.to_yaml().encode(),
        "sensor.yaml": variant.sensor.to_yaml().encode(),
    }
    writer.finish(files, _settings(source, variant) + yaml.safe_dump({"counts": total}, sort_keys=False))


def _mean_points(folder: Path) -> float:
    entries = VariantWriter(folder).manifest().values()
    return sum(entry["counts"]["points"] for entry in entries) / max(len(entries), 1)
