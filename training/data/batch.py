"""Batches of frames as tensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from training.data.frame import TrainingSample


@dataclass(frozen=True, eq=False)
class Batch:
    """A batch of frames.

    Attributes:
        names: of the frames.
        points: (n, 5) float32 index of the frame, x, y, z [m], intensity.
        boxes: per frame, (m, 7) float32 centre, length, width, height [m], yaw [rad].
        kinds: per frame, (m,) int64 class index, −1 ignored.
    """

    names: tuple[str, ...]
    points: Tensor
    boxes: tuple[Tensor, ...]
    class_ids: tuple[Tensor, ...]

    def __len__(self) -> int:
        return len(self.names)

    def to(self, device: torch.device) -> Batch:
        """Move the batch to a device."""
        move = [
            tuple(tensor.to(device, non_blocking=True) for tensor in tensors)
            for tensors in (self.boxes, self.class_ids)
        ]
        return Batch(self.names, self.points.to(device, non_blocking=True), *move)

    def without_intensity(self) -> Batch:
        """Return the batch with all intensities zero."""
        return replace(self, points=torch.nn.functional.pad(self.points[:, :4], (0, 1)))


def collate(samples: Sequence[TrainingSample]) -> Batch:
    """Join frames to a batch."""
    numbered = [np.insert(sample.points, 0, number, axis=1) for number, sample in enumerate(samples)]
    return Batch(
        tuple(sample.name for sample in samples),
        torch.from_numpy(np.concatenate(numbered).astype(np.float32)),
        tuple(torch.from_numpy(np.ascontiguousarray(sample.boxes, np.float32)) for sample in samples),
        tuple(torch.from_numpy(np.asarray(sample.class_ids, np.int64)) for sample in samples),
    )
