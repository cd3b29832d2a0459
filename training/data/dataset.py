"""Training frames in a random order that depends only on the seed and the epoch.

Every random choice is drawn from a generator keyed by (seed, epoch, frame), so that a resumed run
is identical to an uninterrupted one, for any number of loading processes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from torch.utils.data import DataLoader, Dataset

from training.data.augment import Augment, augment
from training.data.batch import Batch, collate
from training.data.frame import TrainingSample
from training.data.object_bank import ObjectBank


class AugmentedFrames(Dataset):
    """Frames by (epoch, index), with a different augmentation in every epoch."""

    def __init__(self, samples: Sequence[TrainingSample], settings: Augment, classes: Sequence[str], seed: int) -> None:
        self._samples, self._settings, self._seed = samples, settings, seed
        wanted = {number: settings.samples.get(name, 0) for number, name in enumerate(classes)}
        wanted = {kind: count for kind, count in wanted.items() if count}
        self._bank = ObjectBank(samples, wanted) if wanted else None

    def __len__(self) -> int:
        return len(self._samples)

    def __getitem__(self, key: tuple[int, int]) -> TrainingSample:
        """Return the augmented frame of an (epoch, index) pair."""
        epoch, index = key
        rng = np.random.default_rng([self._seed, 1, epoch, index])
        return augment(self._samples[index], self._settings, self._bank, rng)


class TrainingSteps:
    """Frames of every training step: shuffled in each epoch and distributed over the training processes.

    Args:
        frames: number of frames.
        batch_size: frames per step and process; the last batch is filled up with the first frames of the epoch.
        seed: random seed of the order.
        rank, world: rank of this process, and number of processes.
    """

    def __init__(self, frames: int, batch_size: int, seed: int, rank: int = 0, world: int = 1) -> None:
        self._frames, self._batch, self._seed = frames, batch_size, seed
        self._rank, self._world = rank, world

    @property
    def per_epoch(self) -> int:
        """Steps in an epoch."""
        return -(-self._frames // (self._batch * self._world))

    def frame_keys(self, step: int) -> list[tuple[int, int]]:
        """(epoch, index) of the frames of a step, counted from the first epoch on."""
        epoch, within = divmod(step, self.per_epoch)
        order = np.random.default_rng([self._seed, 0, epoch]).permutation(self._frames)
        start = (within * self._world + self._rank) * self._batch
        return [(epoch, int(order[(start + i) % self._frames])) for i in range(self._batch)]


class _StepRange:
    """Batch sampler for a range of steps."""

    def __init__(self, steps: TrainingSteps, start: int, end: int) -> None:
        self._steps, self._start, self._end = steps, start, end

    def __iter__(self) -> Iterator[list[tuple[int, int]]]:
        return (self._steps.frame_keys(step) for step in range(self._start, self._end))

    def __len__(self) -> int:
        return self._end - self._start


def load(frames: AugmentedFrames, steps: TrainingSteps, start: int, end: int, workers: int) -> Iterator[Batch]:
    """Load the batches of steps `start` to `end` − 1."""
    return iter(
        DataLoader(
            frames,
            batch_sampler=_StepRange(steps, start, end),  # type: ignore[arg-type]
            num_workers=workers,
            collate_fn=collate,
            pin_memory=False,
        )
    )
