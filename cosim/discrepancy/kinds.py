"""What a diagnosis asks for."""

from __future__ import annotations

from collections.abc import Sequence

from sensors.effects.base import Effect, RoundingEffect
from sensors.effects.registry import effect_classes


def candidate_kinds(extra: Sequence[type[Effect]] = ()) -> tuple[type[Effect], ...]:
    """Effects that a diagnosis asks for: of the catalogue, installed ones, and the user's own."""
    kinds = {kind.name: kind for kind in effect_classes().values() if kind.is_candidate}
    kinds.update({kind.name: kind for kind in extra})
    return tuple(kind for kind in kinds.values() if _is_asked_for(kind))


def _is_asked_for(kind: type[Effect]) -> bool:
    shows = kind.neutral is not None or issubclass(kind, RoundingEffect)
    return shows and kind.stage not in ("label", "traffic")
