"""`python -m training.weights CHECKPOINT`: replace the bundled detector by a trained one."""

from __future__ import annotations

import argparse
import logging
from pathlib import Path

from training.checkpoints import load_detector, save_checkpoint
from training.weights import shipped


def install(checkpoint: Path, target: Path) -> None:
    """Write the model, classes and weights of a checkpoint, without the state of the training."""
    detector, classes = load_detector(checkpoint)
    save_checkpoint(target, detector, detector.settings, classes)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("checkpoint", type=Path)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    install(parser.parse_args().checkpoint, shipped())
    logging.info("%s, %.1f MB", shipped(), shipped().stat().st_size / 1e6)
