"""How long comparing and diagnosing take, and how that grows with frames."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from cosim import compare, diagnose
from cosim.capture.config import RunConfig
from cosim.capture.runner import run
from cosim.engine.child import peak_bytes
from tests.bench.rows import Row

_FRAMES = (10, 20, 40)
_MODEL = "pattern: hdl64e\neffects:\n- {effect: range_noise, sigma_m: 0.02}\n"
_HIDDEN = "- {effect: range_bias, offset_m: 0.05}\n"


def rows() -> Iterator[Row]:
    """Processor time of this process on drives with a range bias that is missing from the model."""
    counts = " / ".join(map(str, _FRAMES))
    compared, diagnosed, verdicts = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        model, measured = Path(folder) / "model.yaml", Path(folder) / "measured.yaml"
        model.write_text(_MODEL)
        measured.write_text(_MODEL + _HIDDEN)
        for count in _FRAMES:
            drive = Path(folder) / f"{count}"
            run(RunConfig(frames=count, seed=3, sensor=str(measured), images=(), store_hits=False), drive)
            compared.append(_own_s(lambda drive=drive: compare(drive, model)) / count)
            diagnosed.append(_own_s(lambda drive=drive: verdicts.append(diagnose(drive, model).verdict)))
    peak = peak_bytes() / 2**20
    yield Row(f"cosim compare, drives of {counts} frames", f"{_slashed(compared, '.2f')} s a frame")
    yield Row(
        f"cosim diagnose, drives of {counts} frames: {', '.join(verdicts)}", f"{_slashed(diagnosed, '.0f')} s", "120"
    )
    yield Row("memory of this process, at most", f"{peak:.0f} MiB")


def _own_s(call: Callable[[], object]) -> float:
    started = time.process_time()
    call()
    return time.process_time() - started


def _slashed(values: list[float], form: str) -> str:
    return " / ".join(format(value, form) for value in values)
