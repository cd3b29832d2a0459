"""The training loop, and its learning rates: one cycle (Smith & Topin, "Super-Convergence", 2018)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import nn
from torch.nn.parallel import DistributedDataParallel

from training.checkpoints import load_weights, read_checkpoint, save_checkpoint
from training.config import TrainConfig
from training.data.batch import Batch
from training.data.dataset import AugmentedFrames, TrainingSteps, load
from training.data.frame import TrainingSample
from training.devices import ProcessContext, explain_out_of_memory
from training.errors import TrainingError
from training.logs import TrainingLog
from training.models.build import build_detector
from training.models.detector import Detector

CHECKPOINT = "checkpoint.pt"
_NOT_DECISIVE = {
    "out",
    "device",
    "precision",
    "workers",
    "checkpoint_every",
    "log_every",
    "validate_every",
    "validate_on",
}


@dataclass(frozen=True)
class Moment:
    """Progress of a training.

    Attributes:
        step, steps: finished steps, and total number of steps.
        epoch: current epoch, from 1.
        losses: losses of the last step, by name.
    """

    step: int
    steps: int
    epoch: int
    losses: dict[str, float]


class Training:
    """A training that can be interrupted at any time; a resumed run gives identical losses.

    Args:
        config: configuration.
        samples: training frames.
        folder: folder of checkpoints and logs.
        process: device, precision and rank of this process.
        validate: returns validation scores of the detector, for the log; none by default.
        on_step: called after every step.
    """

    def __init__(
        self,
        config: TrainConfig,
        samples: list[TrainingSample],
        folder: Path,
        process: ProcessContext,
        validate: Callable[[Detector], dict[str, Any]] = lambda detector: {},
        on_step: Callable[[Moment], None] = lambda moment: None,
    ) -> None:
        self._config, self._folder, self._process = config, folder, process
        self._validate, self._on_step = validate, on_step
        self._frames = AugmentedFrames(samples, config.augment, config.classes, config.seed)
        self._order = TrainingSteps(len(samples), config.batch_size, config.seed, process.rank, process.world)
        self._steps = config.steps or config.epochs * self._order.per_epoch
        torch.manual_seed(config.seed)
        self.detector = build_detector(config.model, config.classes)
        if config.from_checkpoint is not None:
            load_weights(self.detector, config.from_checkpoint, config.classes)
        self.detector.to(process.device)
        self._freeze()
        trainable = [parameter for parameter in self.detector.parameters() if parameter.requires_grad]
        self._optimiser = torch.optim.AdamW(trainable, config.learning_rate, weight_decay=config.weight_decay)
        self._scaler = torch.amp.GradScaler(process.device.type, enabled=process.dtype == torch.float16)
        self._schedule = OneCycle(config.learning_rate, self._steps)

    def run(self) -> Detector:
        """Train to the end.

        Raises:
            TrainingError: the folder contains another training, or memory runs out.
        """
        first_step = self._resume()
        model = self._wrap_parallel()
        log = TrainingLog(self._folder, first_step) if self._process.first else None
        batches = load(self._frames, self._order, first_step, self._steps, self._config.workers)
        start_s = time.monotonic()
        with explain_out_of_memory(self._config):
            for step in range(first_step, self._steps):
                batch = next(batches).to(self._process.device)
                losses = self._step(model, batch, step)
                done = step + 1
                epoch = -(-done // self._order.per_epoch)
                if log is None:
                    continue
                if done % self._config.log_every == 0 or done == self._steps:
                    rate = self._optimiser.param_groups[0]["lr"]
                    seconds = round(time.monotonic() - start_s, 3)
                    log.write(done, epoch=epoch, learning_rate=rate, losses=losses, seconds=seconds)
                self._on_step(Moment(done, self._steps, epoch, losses))
                is_last = done == self._steps
                is_epoch_end = is_last or done % self._order.per_epoch == 0
                if is_epoch_end and (epoch % self._config.validate_every == 0 or is_last):
                    scores = self._validate(self.detector)
                    if scores:
                        log.write(done, epoch=epoch, validation=scores)
                if is_epoch_end or done % self._config.checkpoint_every == 0:
                    self._save(done)
        if log is not None:
            log.close()
        return self.detector

    def _step(self, model: nn.Module, batch: Batch, step: int) -> dict[str, float]:
        torch.manual_seed((self._config.seed * 1_000_003 + step * self._process.world + self._process.rank) % 2**63)
        rate, beta = self._schedule.at(step)
        for group in self._optimiser.param_groups:
            group["lr"], group["betas"] = rate, (beta, 0.99)
        self._set_training()
        with self._process.autocast():
            losses = model(batch)
        total = torch.stack(list(losses.values())).sum()
        if not torch.isfinite(total):
            raise TrainingError(
                f"the loss of step {step + 1} is {total.item()}; lower learning_rate, or precision: float32"
            )
        self._optimiser.zero_grad(set_to_none=True)
        self._scaler.scale(total).backward()
        self._scaler.unscale_(self._optimiser)
        nn.utils.clip_grad_norm_(self.detector.parameters(), self._config.gradient_norm)
        self._scaler.step(self._optimiser)
        self._scaler.update()
        return {name: value.item() for name, value in losses.items()} | {"total": total.item()}

    def _wrap_parallel(self) -> nn.Module:
        if self._process.world == 1:
            return self.detector
        ids = [self._process.device.index] if self._process.device.type == "cuda" else None
        return DistributedDataParallel(self.detector, device_ids=ids, find_unused_parameters=True)

    def _set_training(self) -> None:
        self.detector.train()
        for name in self._config.freeze:
            self.detector.get_submodule(name).eval()

    def _freeze(self) -> None:
        for name in self._config.freeze:
            try:
                part = self.detector.get_submodule(name)
            except AttributeError:
                parts = ", ".join(child for child, _ in self.detector.named_children())
                raise TrainingError(f"freeze names {name!r}; parts of {self._config.model.name} are {parts}") from None
            part.requires_grad_(False)

    def _resume(self) -> int:
        """Load weights and optimiser of a checkpoint; returns the number of finished steps."""
        path = self._folder / CHECKPOINT
        if not path.is_file():
            return 0
        content = read_checkpoint(path)
        saved, current = content.get("config", {}), decisive_settings(self._config)
        changed = [key for key in current if saved.get(key) != current[key]]
        if changed or content.get("world") != self._process.world:
            what = f"{changed[0]} was {saved.get(changed[0])}" if changed else f"with {content.get('world')} processes"
            raise TrainingError(
                f"{self._folder} contains a training with other settings ({what}); choose another --out"
            )
        self.detector.load_state_dict(content["weights"])
        self._optimiser.load_state_dict(content["optimiser"])
        self._scaler.load_state_dict(content["scaler"])
        return int(content["step"])

    def _save(self, step: int) -> None:
        save_checkpoint(
            self._folder / CHECKPOINT,
            self.detector,
            self._config.model,
            self._config.classes,
            optimiser=self._optimiser.state_dict(),
            scaler=self._scaler.state_dict(),
            step=step,
            config=decisive_settings(self._config),
            world=self._process.world,
        )


def decisive_settings(config: TrainConfig) -> dict[str, Any]:
    """Settings that determine the losses."""
    return config.model_dump(mode="json", exclude=_NOT_DECISIVE)


@dataclass(frozen=True)
class OneCycle:
    """Learning rate that rises, then falls; Adam's first beta falls, then rises.

    Attributes:
        highest: maximum learning rate.
        steps: number of steps of the training.
    """

    highest: float
    steps: int
    rising: float = 0.4
    begin_share: float = 0.1
    end_share: float = 1e-4
    betas: tuple[float, float] = (0.95, 0.85)

    def at(self, step: int) -> tuple[float, float]:
        """Learning rate and first beta of a step, counted from 0."""
        peak = max(1.0, self.rising * self.steps)
        slow, fast = self.betas
        if step < peak:
            share = step / peak
            return _eased(self.begin_share * self.highest, self.highest, share), _eased(slow, fast, share)
        share = min(1.0, (step - peak) / max(1.0, self.steps - peak))
        return _eased(self.highest, self.end_share * self.highest, share), _eased(fast, slow, share)


def _eased(begin: float, end: float, share: float) -> float:
    return end + (begin - end) * (1 + math.cos(math.pi * share)) / 2
