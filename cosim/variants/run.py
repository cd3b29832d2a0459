"""`cosim variants`: share the frames out, write them, finish the drives."""

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
from cosim.engine import Do, Engine, Event, LocalEngine, Tell
from cosim.variants.maker import Maker
from cosim.variants.request import Variant, VariantError, read_variants
from cosim.variants.source import Source
from cosim.variants.writer import VariantWriter

_STRETCH = 10  # frames a task; those of one world follow each other, so that it is seldom built
_WRITERS = 3  # threads that wait for the disk while the next frame is made
_VERSIONS = ("cosim", "embreex", "numpy")

Task = list[tuple[str, tuple[str, ...]]]
"""Frames, each with the variants that lack it."""


@dataclass(frozen=True)
class VariantsResult:
    """What is there now.

    Attributes:
        folder: holds a drive a variant.
        frames: frames of the source.
        made: frames of variants this call made; the rest were there.
        points: mean number of points a frame by variant.
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
    on_event: Callable[[Event], None] = lambda event: None,
) -> VariantsResult:
    """Measure a simulated drive again with other sensors, or go on with what was begun.

    Args:
        path: the drive.
        text: its variants, as `read_variants` takes them.
        folder: gets a drive a variant.
        engine: whose processes share the frames; by default one process of this machine.
        on_start: told how many frames are complete already, and of how many.
        on_event: told of every event of the workers.

    Raises:
        CosimError: the drive, the folder or the disk refuses; frames already written stay.
        SensorError: a sensor does not exist, breaks the format, or its effect breaks the rules.
    """
    variants = read_variants(text)
    source = Source(path)
    _refuse_inside(source.drive.root, folder)
    writers = {variant.stem: VariantWriter(folder / variant.stem) for variant in variants}
    with ExitStack() as locks:
        for writer in writers.values():
            locks.enter_context(writer.alone())
        open_writers = {v.stem: writers[v.stem] for v in variants if not writers[v.stem].open(_settings(source, v))}
        done = {stem: frozenset(writer.manifest()) for stem, writer in open_writers.items()}
        left = {name: tuple(stem for stem in done if name not in done[stem]) for name in source.drive.frames}
        left = {name: stems for name, stems in left.items() if stems}
        on_start(len(source.drive) - len(left), len(source.drive))
        job = VariantsJob(path.absolute(), text, folder.absolute())
        skipped = (engine or LocalEngine()).share_out(job, _tasks(source, left), on_event)
        if skipped:
            raise VariantError(f"some frames failed twice, because {skipped[0].reason}; run again to go on with them")
        for variant in variants:
            if variant.stem in open_writers:
                _finish(open_writers[variant.stem], source, variant)
    return VariantsResult(
        folder,
        len(source.drive),
        sum(map(len, left.values())),
        {v.stem: _mean_points(folder / v.stem) for v in variants},
    )


@dataclass(frozen=True)
class VariantsJob:
    """What processes measure again, and where they write."""

    path: Path
    text: str
    folder: Path

    @contextmanager
    def open(self, threads: int) -> Iterator[Do]:
        """Makes stretches of frames, each a `Task`."""
        with ThreadPoolExecutor(_WRITERS) as disk, ExitStack() as locks:
            source, variants = Source(self.path, threads=threads), read_variants(self.text)
            maker = Maker(source, variants)
            writers = {variant.stem: VariantWriter(self.folder / variant.stem) for variant in variants}
            for writer in writers.values():
                locks.enter_context(shared(writer.folder))

            def make(task: Task, tell: Tell) -> None:
                tell(Event("ready"))
                underway: list[Future[None]] = []
                for name, stems in task:
                    frames, linked = maker.make(name, stems), source.linked_files(name)
                    _settle(underway, tell)
                    underway = [
                        disk.submit(writers[stem].write_variant, name, frame, linked, source.sha256)
                        for stem, frame in frames.items()
                    ]
                _settle(underway, tell)

            yield make


def _settle(underway: list[Future[None]], tell: Tell) -> None:
    """Wait until the variants of a frame are on disk, and tell so."""
    for future in underway:
        future.result()
    if underway:
        tell(Event("frame"))


def _tasks(source: Source, left: Mapping[str, tuple[str, ...]]) -> list[Task]:
    """Stretches of frames, each within one world."""
    by_world: dict[str, Task] = {}
    for name, stems in left.items():
        by_world.setdefault(source.world(name), []).append((name, stems))
    return [
        frames[start : start + _STRETCH] for frames in by_world.values() for start in range(0, len(frames), _STRETCH)
    ]


def _refuse_inside(root: Path, folder: Path) -> None:
    inside = folder.resolve()
    if inside == root.resolve() or root.resolve() in inside.parents:
        raise OutputError(f"{folder} lies within the drive {root}; choose another --out")


def _settings(source: Source, variant: Variant) -> str:
    """What the bytes of a variant depend on."""
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


def _finish(writer: VariantWriter, source: Source, variant: Variant) -> None:
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
