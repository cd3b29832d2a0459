"""Sparse 3-D convolution in plain torch: gather, multiply, add up, offset by offset of the kernel.

Submanifold convolution has outputs only at occupied cells (Graham, Engelcke & van der Maaten, CVPR 2018); strided
convolution at all cells whose kernel covers an occupied cell. Weights are laid out as in spconv 2: (out, z, y, x, in).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field, replace

import torch
from torch import Tensor, nn

Triple = tuple[int, int, int]
_Rules = list[tuple[Tensor, Tensor]]


@dataclass(frozen=True, eq=False)
class SparseTensor:
    """Features of occupied cells.

    Attributes:
        features: (n, c).
        place: (n, 4) int64 frame, z, y, x, in ascending order.
        shape: cells along z, y, x.
        frames: number of frames.
        rules: input-output row pairs for each kernel offset, cached for convolutions on the same cells.
    """

    features: Tensor
    coordinates: Tensor
    shape: Triple
    frames: int
    rules: dict[Triple, _Rules] = field(default_factory=dict)

    def with_features(self, features: Tensor) -> SparseTensor:
        """Replace the features."""
        return replace(self, features=features)

    @property
    def keys(self) -> Tensor:
        """(n,) int64 key of each cell, ascending."""
        return cell_keys(self.coordinates, self.shape)

    def dense(self) -> Tensor:
        """(frames, c, z, y, x), zero for empty cells."""
        z, y, x = self.shape
        canvas = self.features.new_zeros(self.frames * z * y * x, self.features.shape[1])
        canvas = canvas.index_copy(0, self.keys, self.features)
        return canvas.reshape(self.frames, z, y, x, -1).permute(0, 4, 1, 2, 3)


def cell_keys(coordinates: Tensor, shape: Triple) -> Tensor:
    """Key of each cell (n, 4), ascending by frame, z, y, x."""
    z, y, x = shape
    return ((coordinates[:, 0] * z + coordinates[:, 1]) * y + coordinates[:, 2]) * x + coordinates[:, 3]


class _Convolution(nn.Module):
    def __init__(self, channels_in: int, channels: int, kernel: Triple) -> None:
        super().__init__()
        self.kernel = kernel
        self.weight = nn.Parameter(torch.empty(channels, *kernel, channels_in))
        spread = math.sqrt(2.0 / (channels_in * 9))  # on a surface about a third of the 27 neighbours is occupied
        nn.init.normal_(self.weight, std=spread)

    def _apply_rules(self, features: Tensor, rules: _Rules, rows: int) -> Tensor:
        weights = self.weight.flatten(1, 3).permute(1, 2, 0)  # (offsets, in, out)
        result: Tensor | None = None
        for weight, (source, target) in zip(weights, rules, strict=True):
            if not len(source):
                continue
            part = features[source] @ weight
            if result is None:
                result = part.new_zeros(rows, part.shape[1])
            result = result.index_add(0, target, part)
        return features.new_zeros(rows, self.weight.shape[0]) if result is None else result


class SubmanifoldConv(_Convolution):
    """Convolution with outputs at the input cells."""

    def forward(self, tensor: SparseTensor) -> SparseTensor:
        """Convolve; the cells do not change."""
        if self.kernel not in tensor.rules:
            tensor.rules[self.kernel] = _neighbours(tensor, self.kernel)
        rules = tensor.rules[self.kernel]
        return tensor.with_features(self._apply_rules(tensor.features, rules, len(tensor.coordinates)))


class StridedConv(_Convolution):
    """Convolution with outputs on a coarser grid, at all cells whose kernel covers an input cell."""

    def __init__(self, channels_in: int, channels: int, kernel: Triple, stride: Triple, padding: Triple) -> None:
        super().__init__(channels_in, channels, kernel)
        self._stride, self._padding = stride, padding

    def forward(self, tensor: SparseTensor) -> SparseTensor:
        """Convolve to the coarser grid."""
        kernel, stride, padding = self.kernel, self._stride, self._padding
        z, y, x = ((tensor.shape[axis] + 2 * padding[axis] - kernel[axis]) // stride[axis] + 1 for axis in range(3))
        shape = (z, y, x)
        limits = torch.tensor(shape, device=tensor.coordinates.device)
        step = torch.tensor(stride, device=tensor.coordinates.device)
        sources, keys = [], []
        for offset in itertools.product(*(range(size) for size in kernel)):
            moved = (
                tensor.coordinates[:, 1:]
                + torch.tensor(padding, device=limits.device)
                - torch.tensor(offset, device=limits.device)
            )
            target_cell = torch.div(moved, step, rounding_mode="floor")
            fits = ((moved % step == 0) & (target_cell >= 0) & (target_cell < limits)).all(1)
            rows = torch.nonzero(fits)[:, 0]
            sources.append(rows)
            keys.append(cell_keys(torch.cat([tensor.coordinates[rows, :1], target_cell[rows]], 1), shape))
        cells, target = torch.unique(torch.cat(keys), return_inverse=True)
        rules = list(zip(sources, target.split([len(rows) for rows in sources]), strict=True))
        coordinates = _unravel_keys(cells, shape)
        return SparseTensor(
            self._apply_rules(tensor.features, rules, len(coordinates)), coordinates, shape, tensor.frames
        )


def find_cells(keys: Tensor, wanted: Tensor) -> tuple[Tensor, Tensor]:
    """Rows of `keys` (n,), ascending, that equal `wanted` (…): the rows, and whether each exists."""
    rows = torch.searchsorted(keys, wanted).clamp(max=len(keys) - 1)
    return rows, keys[rows] == wanted


def _neighbours(tensor: SparseTensor, kernel: Triple) -> _Rules:
    keys, rules = tensor.keys, []
    limits = torch.tensor(tensor.shape, device=tensor.coordinates.device)
    for offset in itertools.product(*(range(-(size // 2), size // 2 + 1) for size in kernel)):
        coordinates = tensor.coordinates[:, 1:] + torch.tensor(offset, device=limits.device)
        inside = torch.nonzero(((coordinates >= 0) & (coordinates < limits)).all(1))[:, 0]
        wanted = cell_keys(torch.cat([tensor.coordinates[inside, :1], coordinates[inside]], 1), tensor.shape)
        rows, exists = find_cells(keys, wanted)
        rules.append((rows[exists], inside[exists]))
    return rules


def _unravel_keys(cells: Tensor, shape: Triple) -> Tensor:
    z, y, x = shape
    return torch.stack([cells // (z * y * x), cells // (y * x) % z, cells // x % y, cells % x], 1)


class SparseSequential(nn.Sequential):
    """Convolutions on sparse tensors, norms and activations on their features."""

    def forward(self, input: SparseTensor) -> SparseTensor:
        """Layer after layer."""
        for layer in self:
            sparse = isinstance(layer, _Convolution | SparseSequential)
            input = layer(input) if sparse else input.with_features(layer(input.features))
        return input
