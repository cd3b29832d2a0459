"""Variants of data with known truth: each is read correctly or refused; a different result is a silent error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

#: Draws a variant, reads it; returns what was drawn, and how the reading differs from the truth (None: it agrees).
Trial = Callable[[np.random.Generator, list[str]], str | None]


@dataclass(frozen=True)
class Outcome:
    """Results of many variants.

    Attributes:
        read: number of variants read, and equal to the truth.
        refused: variants refused, with their messages.
        wrong: variants read with another meaning: seed, what was drawn, what differs.
        foreign: exceptions that are not the project's own.
    """

    read: int
    refused: tuple[str, ...]
    wrong: tuple[str, ...]
    foreign: tuple[str, ...]


def try_variants(trial: Trial, refusals: tuple[type[Exception], ...], trials: int, seed: int) -> Outcome:
    """Read variants, each drawn with its own seed.

    Args:
        trial: called with a generator and a list that it fills with what it draws.
        refusals: exceptions that refuse a file.
        trials: number of variants.
        seed: of the first variant.
    """
    right = 0
    refused, wrong, foreign = [], [], []
    for number in range(seed, seed + trials):
        drawn: list[str] = []
        try:
            difference = trial(np.random.default_rng(number), drawn)
        except refusals as error:
            refused.append(f"{number}: {'; '.join(drawn)}: {error}")
            if "\n" in str(error):
                foreign.append(f"{number}: {'; '.join(drawn)}: a message of several lines: {error!r}")
        except Exception as error:  # noqa: BLE001 - every foreign exception is counted
            foreign.append(f"{number}: {'; '.join(drawn)}: {type(error).__name__}: {error}")
        else:
            if difference is None:
                right += 1
            else:
                wrong.append(f"{number}: {'; '.join(drawn)}: {difference}")
    return Outcome(right, tuple(refused), tuple(wrong), tuple(foreign))
