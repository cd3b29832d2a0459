"""Transmission through a window, twice, and the echo of the pane itself."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from sensors.effects.base import EchoEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class GlassTransmission(EchoEffect):
    """The echo behind the first pane is scaled by T², T one-way; the pane answers with (1 − T)·cos θ.

    `last` reports the echo behind (the pane without another echo), `first` the pane, `strongest` the larger,
    `dual` both: the larger as return 0, the other as return 1.
    """

    name: ClassVar = "glass_transmission"
    phase: ClassVar = Phase.GLASS
    channel: ClassVar = "intensity"
    also: ClassVar = ("range", "drop")
    equation: ClassVar = "I_behind·T²;  I_pane = (1 − T)·cos θ"
    reference: ClassVar = "Hecht: Optics, ch. 4; Velodyne VLP-16 user's manual, return modes"
    taxonomy: ClassVar = "sp46"
    confusable_with: ClassVar = ("mirror_ghost", "random_dropout")
    example: ClassVar = {"transmission": 0.6, "mode": "strongest"}
    neutral: ClassVar = {"transmission": 1.0, "mode": "last"}
    shapes: ClassVar = tuple(
        {"transmission": transmission, "mode": mode}
        for mode in ("last", "strongest", "first")
        for transmission in (0.9, 0.6)
    )

    transmission: float = number("T, share of light a pane lets through, one way", ge=0, le=1)
    mode: Literal["first", "strongest", "last", "dual"] = Field(description="which of the echoes is reported")

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns of panes and of surfaces behind them."""
        panes = shot.panes
        signal = ((1 - self.transmission) * shot.cos_incidence(panes)).astype(np.float32)
        panes = replace(panes, intensity=signal)
        # Rows are sorted by beam and one a beam here.
        row = np.minimum(np.searchsorted(returns.beam, panes.beam), max(len(returns) - 1, 0))
        seen_through = returns.beam[row] == panes.beam if len(returns) else np.zeros(len(panes), bool)
        behind = row[seen_through]
        intensity = returns.intensity.copy()
        intensity[behind] *= np.float32(self.transmission**2)
        returns = replace(returns, intensity=intensity)
        solid = np.zeros(len(panes), np.float32)
        solid[seen_through] = intensity[behind]
        stronger = signal > solid
        if self.mode == "dual":
            first = ~seen_through | stronger
            second = np.zeros(len(returns), np.uint8)
            second[behind] = first[seen_through]
            numbered = replace(panes, return_no=(~first).astype(np.uint8))
            # A perfect pane and perfect blackness give no echo.
            numbered = numbered.take(signal > 0)
            return replace(returns, return_no=second).merged(numbered)
        chosen = {"first": signal > 0, "last": ~seen_through & (signal > 0), "strongest": stronger}[self.mode]
        return returns.replacing_beams(panes.take(chosen))
