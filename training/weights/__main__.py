"""`python -m training.weights CHECKPOINT`: puts a trained detector in the place of the one that comes along."""

from __future__ import annotations

import argparse
import logging
from pathlib import Path

from training.checkpoints import load_detector, save_checkpoint
from training.weights import shipped


def install(checkpoint: Path, target: Path) -> None:
    """Write a checkpoint's model, classes and weights without what only a training needs."""
    detector, classes = load_detector(checkpoint)
    save_checkpoint(target, detector, detector.settings, classes)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("checkpoint", type=Path)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    install(parser.parse_args().checkpoint, shipped())
    logging.info("%s, %.1f MB", shipped(), shipped().stat().st_size / 1e6)
