"""`python -m training.train CONFIG.yaml`: train without the `cosim` command, for example with `torchrun`.

Progress is logged to stderr, at most one line per minute; `cosim train` does the same with a progress bar.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cosim.drives.writer import explained
from cosim.user_errors import user_errors
from training.config import load_train_config
from training.errors import TrainingError, demand_torch

if TYPE_CHECKING:
    from training.loop import Moment

_LOG = logging.getLogger("training")
_EVERY_S = 60.0


def main(arguments: Sequence[str] | None = None) -> int:
    """Train, or resume a training; returns the exit code: 0, or 2 for bad input."""
    parser = argparse.ArgumentParser(prog="python -m training.train", description=__doc__)
    parser.add_argument("config", type=Path, metavar="CONFIG.yaml", help="configuration of the training")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of checkpoints and logs (default: its `out`)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the scores as JSON")
    parser.add_argument("--quiet", action="store_true", help="log errors only")
    options = parser.parse_args(arguments)
    is_silent = options.quiet or os.environ.get("RANK", "0") != "0"  # only the first process logs
    logging.basicConfig(level=logging.ERROR if is_silent else logging.INFO, format="%(message)s")
    try:
        train(options.config, options.out, options.json)
    except user_errors() as error:
        sys.stderr.write(f"{parser.prog}: {error}\n")
        return 2
    return 0


def train(config_path: Path, out: Path | None = None, json_path: Path | None = None) -> None:
    """Train with a configuration.

    Args:
        config_path: the configuration.
        out: folder of checkpoints and logs; by default the configuration's `out`.
        json_path: file for `{"out": …, "scores": …}`; None: not written.

    Raises:
        CosimError: the configuration, a drive or a checkpoint cannot be used, or torch is not installed.
    """
    config = load_train_config(config_path)
    folder = out or config.out
    if folder is None:
        raise TrainingError(f"{config_path} names no folder for the results; add `out: DIR`, or give --out DIR")
    demand_torch()
    from training.run import Watcher, run_training

    scores = run_training(config, folder, Watcher(on_step=_MinuteLog().log))
    if json_path is not None:
        with explained(json_path):
            json_path.write_text(json.dumps({"out": str(folder), "scores": scores}, indent=2) + "\n", encoding="utf-8")


class _MinuteLog:
    """Log the progress of a training, one line per minute."""

    def __init__(self) -> None:
        self._last_s = float("-inf")

    def log(self, moment: Moment) -> None:
        now_s = time.monotonic()
        if moment.step < moment.steps and now_s - self._last_s < _EVERY_S:
            return
        self._last_s = now_s
        total = moment.losses["total"]
        _LOG.info("step %d of %d, epoch %d, loss %.3f", moment.step, moment.steps, moment.epoch, total)


if __name__ == "__main__":
    sys.exit(main())
