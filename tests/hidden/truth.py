"""The truth of one unseen effect, in the words in which a diagnosis may report it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

_MOST_BESIDE = 1  # covariates named in addition to the right ones


@dataclass(frozen=True)
class Finding:
    """The correct finding for one unseen effect.

    Attributes:
        channels: accepted channel names; the first is the one that the effect changes.
        covariates: one entry per variable; each lists the accepted names of it.
        effects: catalogue effects that describe the same data equally well.
        beside: catalogue effects that may be reported in addition without being false.
        also: other findings that describe the same data equally well.
        curve: the true shape over one numeric covariate: `covariate`, `unit`, `x`, `y`; empty where none exists.
    """

    channels: tuple[str, ...]
    covariates: tuple[tuple[str, ...], ...]
    effects: tuple[str, ...] = ()
    beside: tuple[str, ...] = ()
    also: tuple[Finding, ...] = ()
    curve: Mapping[str, Any] | None = None

    def accepts(self, finding: Mapping[str, Any]) -> bool:
        """Whether a finding `{channel, covariates, …}` has the right channel and all covariates."""
        if self._has_channel(finding) and self._has_covariates(finding):
            return True
        return any(other.accepts(finding) for other in self.also)

    def accepts_channel(self, finding: Mapping[str, Any]) -> bool:
        """Whether a finding is in the right channel."""
        return self._has_channel(finding) or any(other.accepts_channel(finding) for other in self.also)

    def accepts_part(self, finding: Mapping[str, Any]) -> bool:
        """Whether a finding has the right channel and at least one right covariate."""
        if self._has_channel(finding) and (not self.covariates or self._names & set(finding.get("covariates") or ())):
            return True
        return any(other.accepts_part(finding) for other in self.also)

    def names_effect(self, name: str) -> bool:
        """Whether a catalogue effect describes the same data equally well."""
        return name in self.effects or any(other.names_effect(name) for other in self.also)

    @property
    def _names(self) -> set[str]:
        return {name for names in self.covariates for name in names}

    def _has_channel(self, finding: Mapping[str, Any]) -> bool:
        return finding.get("channel") in self.channels

    def _has_covariates(self, finding: Mapping[str, Any]) -> bool:
        """Whether every variable is named and at most one other covariate."""
        named: Sequence[str] = finding.get("covariates") or ()
        each = all(any(name in named for name in names) for names in self.covariates)
        return each and sum(name not in self._names for name in named) <= _MOST_BESIDE

    def to_json(self) -> dict[str, Any]:
        """As written next to a made drive."""
        return {
            "channels": list(self.channels),
            "covariates": [list(names) for names in self.covariates],
            "effects": list(self.effects),
            "beside": list(self.beside),
            "also": [other.to_json() for other in self.also],
            "curve": self.curve,
        }

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> Finding:
        """Read what `to_json` wrote."""
        return cls(
            tuple(document["channels"]),
            tuple(tuple(names) for names in document["covariates"]),
            tuple(document["effects"]),
            tuple(document["beside"]),
            tuple(cls.from_json(other) for other in document["also"]),
            document["curve"],
        )
