"""2-D backbone in the bird's-eye view: stages of convolutions, upsampled to one grid and concatenated.

Parameters are named as in OpenPCDet's `BaseBEVBackbone`: `blocks.S.N`, `deblocks.S.N`.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn


class BevBackbone(nn.Module):
    """Stages of 3 × 3 convolutions, the first of each with a stride."""

    def __init__(
        self,
        channels_in: int,
        layers: Sequence[int],
        strides: Sequence[int],
        channels: Sequence[int],
        upsample: Sequence[int],
        upsample_channels: Sequence[int],
    ) -> None:
        super().__init__()
        before = (channels_in, *channels)
        self.blocks = nn.ModuleList(_stage(before[i], channels[i], layers[i], strides[i]) for i in range(len(layers)))
        self.deblocks = nn.ModuleList(
            nn.Sequential(
                nn.ConvTranspose2d(channels[i], upsample_channels[i], upsample[i], stride=upsample[i], bias=False),
                _norm(upsample_channels[i]),
                nn.ReLU(),
            )
            for i in range(len(layers))
        )
        self.channels = sum(upsample_channels)
        # Memory format of the pillars; reduces the time on CPUs by a quarter.
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def forward(self, image: Tensor) -> Tensor:
        """(b, channels, rows, columns) on the common grid of an image (b, c, ny, nx)."""
        refined = []
        for block, deblock in zip(self.blocks, self.deblocks, strict=True):
            image = block(image)
            refined.append(deblock(image))
        return torch.cat(refined, 1)


def _stage(channels_in: int, channels: int, further: int, stride: int) -> nn.Sequential:
    layers: list[nn.Module] = [
        nn.Identity(),  # OpenPCDet pads in a layer of its own
        nn.Conv2d(channels_in, channels, 3, stride=stride, padding=1, bias=False),
        _norm(channels),
        nn.ReLU(),
    ]
    for _ in range(further):
        layers += [nn.Conv2d(channels, channels, 3, padding=1, bias=False), _norm(channels), nn.ReLU()]
    return nn.Sequential(*layers)


def _norm(channels: int) -> nn.BatchNorm2d:
    return nn.BatchNorm2d(channels, eps=1e-3, momentum=0.01)
