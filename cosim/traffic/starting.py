"""Start SUMO at the beginning of a scenario or from a saved state.

Saved states are changed so that the sublane model continues from them in the same way in every process: in a saved
state, `lcStateBase` of a vehicle is the state of its lane change model, followed by pairs of an acceleration and a
flag: the speed advice that the model has stored for the next step. SUMO 1.28 restores this advice, but the constructor
of the sublane model (`MSLCM_SL2015`) does not initialise `myDontBrake`. Until vehicles change lanes in the first step,
this member has the value that was in its memory before, and it decides whether a vehicle with speed advice follows it.
The speed of this vehicle, and later that of others, would therefore depend on the layout of the memory, which differs
between processes. SUMO does not use the member of vehicles without speed advice.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from cosim.errors import CosimError
from sumo_nets.tools import first_error

_SUBLANE_M = 0.8  # lane changes take their time; SUMO's own default is a jump
_SPEED_ADVICE = re.compile(r'(\blcStateBase="[^" ]*) [^"]*(?=")')


class TrafficError(CosimError):
    """SUMO refuses the scenario, or the simulation cannot go on."""


@dataclass(frozen=True)
class SavedState:
    """A simulation to go on with: the file, and its time [s]."""

    path: Path
    time_s: float


def scenario_options(sumocfg: Path, seed: int, step_s: float) -> list[str]:
    """Options of SUMO with which every simulation of a scenario runs: seed and step length [s], no teleports."""
    return [
        *("-c", str(sumocfg)),
        *("--seed", str(seed % 2**31)),
        *("--step-length", str(step_s)),
        *("--time-to-teleport", "-1"),
        *("--collision.action", "warn"),
        *("--collision.mingap-factor", "0"),
        "--save-state.transportables",
    ]


def start_sumo(
    sumocfg: Path, seed: int, step_s: float, *, state: SavedState | None = None, sublane: bool = True
) -> ModuleType:
    """The running libsumo.

    Args:
        sumocfg: scenario file.
        seed: SUMO's seed.
        step_s: step length [s].
        state: saved state to start from.
        sublane: whether changes of lane take their time, at twice the cost of a step.

    Raises:
        TrafficError: SUMO refuses the scenario, or another simulation runs in this process.
    """
    command = ["sumo", *scenario_options(sumocfg, seed, step_s)]
    if sublane:
        command += ["--lateral-resolution", str(_SUBLANE_M)]
    if state is not None:
        path = drop_speed_advice(state.path) if sublane else state.path
        command += ["--load-state", str(path), "--begin", str(state.time_s)]
    return _start(command)


def start_empty(net: Path, additional: Path, begin_s: float, step_s: float, options: Mapping[str, str]) -> ModuleType:
    """Start libsumo on an empty network.

    Args:
        net: the network.
        additional: what belongs to it.
        begin_s: start time [s].
        step_s: step length [s].
        options: others of SUMO.

    Raises:
        TrafficError: SUMO refuses the files, or another simulation runs in this process.
    """
    command = [
        "sumo",
        *("-n", str(net)),
        *("-a", str(additional)),
        *("--begin", str(begin_s)),
        *("--step-length", str(step_s)),
    ]
    return _start([*command, *(word for name, value in options.items() for word in (f"--{name}", value))])


def start_sumo_with(options: list[str]) -> ModuleType:
    """The running libsumo with the options of its command line.

    Raises:
        TrafficError: SUMO refuses the files, or another simulation runs in this process.
    """
    return _start(["sumo", *options])


def load_libsumo() -> ModuleType:
    """Import libsumo without the warning that it prints where another version of pyarrow is installed.

    The libraries conflict only where one process loads both, and no module of this package imports pyarrow.

    Raises:
        TrafficError: it cannot be loaded.
    """
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            import libsumo
    except ImportError as error:
        raise TrafficError(f"SUMO's library cannot be loaded: {error}; run `sh tools/setup.sh`") from error
    return libsumo


def _start(command: list[str]) -> ModuleType:
    """Start libsumo; what it complains of becomes the error's line instead of noise on the terminal."""
    libsumo = load_libsumo()
    if libsumo.simulation.isLoaded():
        raise TrafficError("a SUMO simulation already runs in this process; close it first or use another process")
    with _captured_stderr() as complaints:
        try:
            libsumo.start([*command, "--no-step-log", "--no-warnings"])
        except (libsumo.TraCIException, libsumo.FatalTraCIError, RuntimeError) as error:
            reason = first_error(complaints().strip() or str(error))
            raise TrafficError(f"SUMO refuses {command[2]}: {reason}") from error
    return libsumo


def describe_stop(message: str) -> str:
    """SUMO's message about its end as one line, with the remedy for a vehicle without a route."""
    said = " ".join(message.split()).rstrip(".")
    if "no valid route" not in said:
        return said
    remedy = 'leave such vehicles out with <ignore-route-errors value="true"/> in the .sumocfg'
    return f"{said}; correct its route, or {remedy}"


@contextlib.contextmanager
def _captured_stderr() -> Iterator:
    """Collect what native code writes to the standard error stream."""
    with tempfile.TemporaryFile() as sink:
        kept = os.dup(2)
        os.dup2(sink.fileno(), 2)

        def text() -> str:
            sink.seek(0)
            return sink.read().decode(errors="replace")

        try:
            yield text
        finally:
            os.dup2(kept, 2)
            os.close(kept)


def drop_speed_advice(path: Path) -> Path:
    """Remove the speed advice from a saved state; the lane change model computes it again in the first step.

    Args:
        path: saved state, not compressed.

    Returns:
        Path of the changed copy, in the same folder; `path` itself if no vehicle has a speed advice.
    """
    text, count = _SPEED_ADVICE.subn(r"\1", path.read_text(encoding="utf-8"))
    if not count:
        return path
    changed = path.with_name(f"{path.stem}-sublane{path.suffix}")
    changed.write_text(text, encoding="utf-8")
    return changed
