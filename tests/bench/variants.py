"""How fast the paper's eight variants are made of a drive, and where their time goes."""

from __future__ import annotations

import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from rich.table import Table

from cosim.capture.config import RunConfig
from cosim.capture.runner import run
from cosim.variants import PAPER
from cosim.variants.maker import Maker
from cosim.variants.request import read_variants
from cosim.variants.source import VariantSource
from cosim.variants.writer import VariantWriter

_FRAMES = 8


def table() -> Table:
    """Processor time of a frame of all eight in one process, on a drive of one town."""
    with tempfile.TemporaryDirectory() as folder:
        run(RunConfig(frames=_FRAMES, seed=2), Path(folder) / "drive")
        seconds = _timed(Path(folder))
    result = Table(title=f"Eight variants of {_FRAMES} frames, processor time of a frame")
    for column in ("", "ms"):
        result.add_column(column, justify="left" if not column else "right")
    for name, value in seconds.items():
        result.add_row(name, f"{value * 1e3:.0f}")
    result.add_row("frames a second of a core", f"{1 / sum(seconds.values()):.1f}")
    return result


def _timed(folder: Path) -> dict[str, float]:
    source = VariantSource(folder / "drive")
    maker = Maker(source, read_variants("all"))
    writers = {stem: VariantWriter(folder / stem) for stem in PAPER}
    maker.make(source.drive.frames[0], PAPER)  # builds the world
    spent = {"measuring": 0.0, "writing": 0.0}
    with ThreadPoolExecutor(3) as disk:
        for name in source.drive.frames[1:]:
            started = time.process_time()
            frames = maker.make(name, PAPER)
            made = time.process_time()
            linked = source.linked_files(name)
            jobs = [disk.submit(writers[s].write_variant, name, f, linked, source.sha256) for s, f in frames.items()]
            for job in jobs:
                job.result()
            spent["measuring"] += made - started
            spent["writing"] += time.process_time() - made
    return {name: value / (len(source.drive) - 1) for name, value in spent.items()}
