"""Warm-up of a scenario by SUMO's program, in a process of its own next to other work."""

from __future__ import annotations

import subprocess
from pathlib import Path

from cosim.traffic.starting import SavedState, TrafficError, describe_stop, scenario_options
from sumo_nets.tools import first_error, tool_command

_STEP_S = 0.5


class WarmUp:
    """A running warm-up, with long steps and instantaneous lane changes.

    Args:
        sumocfg: scenario file; its simulation starts at 0 s.
        seed: SUMO's seed.
        seconds: simulated time; rounded to half seconds.
        folder: existing folder where the state is written.

    Raises:
        TrafficError: SUMO's program cannot be started.
    """

    def __init__(self, sumocfg: Path, seed: int, seconds: float, folder: Path) -> None:
        end_s = round(seconds / _STEP_S) * _STEP_S
        self._saved = SavedState(folder / "warm.xml", end_s)
        self._messages = folder / "warm_up.log"
        command, environment = tool_command(
            "sumo",
            *scenario_options(sumocfg, seed, _STEP_S),
            *("--begin", "0"),
            *("--end", str(end_s + _STEP_S)),
            *("--save-state.times", str(end_s)),
            *("--save-state.files", self._saved.path),
            *("--no-step-log", "--no-warnings"),
        )
        try:
            with self._messages.open("wb") as messages:
                self._process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=messages)
        except OSError as error:
            raise TrafficError(f"SUMO's program could not be started: {error}") from error

    def state(self) -> SavedState:
        """Wait for the end of the warm-up; return the saved state.

        Raises:
            TrafficError: SUMO refuses the scenario, or stopped.
        """
        code = self._process.wait()
        if code < 0:
            raise TrafficError(f"SUMO was stopped by signal {-code} during the warm-up")
        if code or not self._saved.path.is_file():
            message = describe_stop(first_error(self._messages.read_text(encoding="utf-8", errors="replace")))
            raise TrafficError(f"SUMO stopped during the warm-up: {message}")
        return self._saved

    def stop(self) -> None:
        """End the warm-up; does nothing if it has ended."""
        self._process.kill()
        self._process.wait()
