"""Device, precision and process group of a training."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import timedelta

import torch
from torch import distributed

from training.config import TrainConfig
from training.errors import TrainingError

_PATIENCE = timedelta(hours=2)  # the other processes wait while the first one validates the detector


@dataclass(frozen=True)
class ProcessContext:
    """A process of a training.

    Attributes:
        device: device of the computation.
        dtype: data type of the convolutions.
        rank: rank of this process among `world` processes.
    """

    device: torch.device
    dtype: torch.dtype
    rank: int = 0
    world: int = 1

    @property
    def first(self) -> bool:
        """Whether this process writes logs and checkpoints."""
        return self.rank == 0

    def autocast(self) -> torch.autocast:
        """The context of the forward pass."""
        return torch.autocast(self.device.type, self.dtype, enabled=self.dtype != torch.float32)


@contextlib.contextmanager
def join_processes(config: TrainConfig) -> Iterator[ProcessContext]:
    """Select device and precision of a configuration, and join the processes started by torchrun.

    The processes leave the group together: threads of gloo outlive it, and a process that exits while another one
    still sends gradients of the last step could be aborted.

    Raises:
        TrainingError: a GPU is requested, but none is available.
    """
    rank, world = int(os.environ.get("RANK", 0)), int(os.environ.get("WORLD_SIZE", 1))
    device = find_device(config.device)
    if device.type == "cuda":
        device = torch.device("cuda", int(os.environ.get("LOCAL_RANK", 0)))
        torch.cuda.set_device(device)
    if world > 1:
        distributed.init_process_group("nccl" if device.type == "cuda" else "gloo", timeout=_PATIENCE)
    try:
        yield ProcessContext(device, _dtype(config.precision, device), rank, world)
        if world > 1:
            distributed.barrier()
    finally:
        if world > 1:
            distributed.destroy_process_group()


def find_device(wanted: str) -> torch.device:
    """Return a device by name, or the best available one for `auto`.

    Raises:
        TrainingError: a GPU is requested, but none is available.
    """
    if wanted == "cuda" and not torch.cuda.is_available():
        raise TrainingError(
            "device is cuda, but torch finds no GPU here; write `device: auto`, or install torch for CUDA"
        )
    if wanted == "auto":
        wanted = "cuda" if torch.cuda.is_available() else "cpu"
    return torch.device(wanted)


def _dtype(precision: str, device: torch.device) -> torch.dtype:
    if precision != "auto":
        return getattr(torch, precision)
    if device.type == "cuda":
        return torch.bfloat16 if torch.cuda.is_bf16_supported() else torch.float16
    return torch.bfloat16 if _computes_in_bfloat16() else torch.float32


def _computes_in_bfloat16() -> bool:
    """Check for bfloat16 instructions of the CPU with torch's own tests, which are not public."""
    tests = (getattr(torch.cpu, name, None) for name in ("_is_amx_tile_supported", "_is_avx512_bf16_supported"))
    return any(test is not None and test() for test in tests)


@contextlib.contextmanager
def explain_out_of_memory(config: TrainConfig) -> Iterator[None]:
    """Convert out-of-memory errors into an error that names the setting to lower."""
    try:
        yield
    except (MemoryError, RuntimeError) as error:
        words = str(error).lower()
        full = isinstance(error, MemoryError | torch.OutOfMemoryError)
        if not full and "out of memory" not in words and "can't allocate memory" not in words:
            raise
        lower = "`batch_size`" if config.batch_size > 1 else "`model: {max_cells: …}` or the range `low_m`, `high_m`"
        raise TrainingError(
            f"out of memory with batch_size {config.batch_size}; lower {lower}; a checkpoint of "
            "other settings is kept, so give another --out if there is one already"
        ) from error
