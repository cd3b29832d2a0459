"""What a hidden unknown effect is, in the words in which a diagnosis may tell it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

_MOST_BESIDE = 1  # covariates named beside the right ones


@dataclass(frozen=True)
class Told:
    """The truth of one unknown effect.

    Attributes:
        channels: names of channels that are right; the first is the one it acts in.
        covariates: one entry a variable; each lists the names that honestly say the same of the same data.
        effects: catalogue effects that honestly say the same.
    """

    channels: tuple[str, ...]
    covariates: tuple[tuple[str, ...], ...]
    effects: tuple[str, ...] = ()

    def accepts(self, finding: Mapping[str, Any]) -> bool:
        """Whether a finding `{channel, covariates, …}` tells this effect."""
        return self.accepts_channel(finding) and self.accepts_covariates(finding)

    def accepts_channel(self, finding: Mapping[str, Any]) -> bool:
        """Whether it is in the right channel."""
        return finding.get("channel") in self.channels

    def accepts_covariates(self, finding: Mapping[str, Any]) -> bool:
        """Whether every variable is named and at most one that is none of them."""
        named: Sequence[str] = finding.get("covariates") or ()
        right = {name for names in self.covariates for name in names}
        each = all(any(name in named for name in names) for names in self.covariates)
        return each and sum(name not in right for name in named) <= _MOST_BESIDE

    def to_json(self) -> dict[str, Any]:
        """As written beside a made drive."""
        return {"channels": self.channels, "covariates": self.covariates, "effects": self.effects}
