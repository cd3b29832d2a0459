"""The sparse stages of SECOND and Voxel R-CNN: 8 × coarser, then flattened to the bird's-eye view.

Parameters are named as in OpenPCDet's `VoxelBackBone8x`.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from training.models.sparse_conv import SparseSequential, SparseTensor, StridedConv, SubmanifoldConv, Triple

_CUBE: Triple = (3, 3, 3)


class VoxelBackbone(nn.Module):
    """Four stages of sparse convolutions, and one that halves the height.

    Args:
        channels: channels of the first stage, the three coarser ones, and the last.
        cells: numbers of cells along x, y, z.
    """

    def __init__(self, channels: tuple[int, int, int, int, int], cells: Triple) -> None:
        super().__init__()
        a, b, c, d, e = channels
        self.shape: Triple = (cells[2] + 1, cells[1], cells[0])
        self.conv_input = _submanifold_block(4, a)
        self.conv1 = SparseSequential(_submanifold_block(a, a))
        self.conv2 = SparseSequential(_strided_block(a, b), _submanifold_block(b, b), _submanifold_block(b, b))
        self.conv3 = SparseSequential(_strided_block(b, c), _submanifold_block(c, c), _submanifold_block(c, c))
        self.conv4 = SparseSequential(
            _strided_block(c, d, (0, 1, 1)), _submanifold_block(d, d), _submanifold_block(d, d)
        )
        self.conv_out = SparseSequential(StridedConv(d, e, (3, 1, 1), (2, 1, 1), (0, 0, 0)), _norm(e), nn.ReLU())
        height = self.shape[0]
        for padding in (1, 1, 0):
            height = (height + 2 * padding - 3) // 2 + 1
        self.channels = e * ((height - 3) // 2 + 1)
        self.stage_channels = (b, c, d)

    def forward(self, features: Tensor, coordinates: Tensor, frames: int) -> tuple[Tensor, list[SparseTensor]]:
        """Bird's-eye features (frames, channels, y / 8, x / 8), and the stages 2, 4 and 8 × coarser."""
        first = self.conv1(self.conv_input(SparseTensor(features, coordinates, self.shape, frames)))
        second = self.conv2(first)
        third = self.conv3(second)
        fourth = self.conv4(third)
        dense = self.conv_out(fourth).dense()
        return torch.flatten(dense, 1, 2), [second, third, fourth]


def _submanifold_block(channels_in: int, channels: int) -> SparseSequential:
    return SparseSequential(SubmanifoldConv(channels_in, channels, _CUBE), _norm(channels), nn.ReLU())


def _strided_block(channels_in: int, channels: int, padding: Triple = (1, 1, 1)) -> SparseSequential:
    return SparseSequential(StridedConv(channels_in, channels, _CUBE, (2, 2, 2), padding), _norm(channels), nn.ReLU())


def _norm(channels: int) -> nn.BatchNorm1d:
    return nn.BatchNorm1d(channels, eps=1e-3, momentum=0.01)
