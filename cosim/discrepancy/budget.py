"""Where the error comes from: noise, poses, objects, the map, what is missing, and what nobody knows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.discrepancy.aligned import PARTS, Aligned, HeldOut, Judged
from cosim.discrepancy.state import Case, View
from sensors.effects.base import Effect


@dataclass(frozen=True, eq=False)
class Budget:
    """An error and what it is made of, on frames that took no part in fitting effects.

    Attributes:
        error: of the model as it was given, at the poses as given.
        error_aligned: of the model as it ends, poses, objects and surfaces where the fit has them.
        given_aligned: the same of the model as it was given.
        floor: the error of a model that is right up to noise, on the beams of `error_aligned`; None if not known.
        parts: noise, poses, objects, map, missing and unexplained; they add up to `error`.
        steps: errors at the poses as given, of the model with none of what was found, one, two and so on.
        aligned_steps: the same, poses, objects and surfaces where the fit has them.
    """

    error: float
    error_aligned: float
    given_aligned: float
    floor: float | None
    parts: dict[str, float]
    steps: tuple[HeldOut, ...]
    aligned_steps: tuple[HeldOut, ...] = ()


def budget_of(case: Case, view: View, models: Sequence[tuple[Effect, ...]]) -> tuple[Budget, Judged]:
    """The budget of a model, or of one that effects were added to, and the frames that it was judged by.

    Args:
        case: of the diagnosis.
        view: frames that judge, as they are told in the end.
        models: the effects as given, and after every finding.
    """
    last = Aligned(case, view, models[-1])
    seen = [Aligned(case, view, models[0], [last])] if len(models) > 1 else []
    for effects in models[1:-1]:
        seen.append(Aligned(case, view, effects, [seen[-1], last]))
    seen.append(last)
    first, floor, aligned = seen[0], last.floor(), last.error(PARTS)
    noise = aligned if floor is None else min(floor, aligned)
    parts = {"noise": noise}
    for place, name in enumerate(PARTS):
        before, after, rest = PARTS[:place], PARTS[: place + 1], PARTS[place + 1 :]
        orders = ((before, after), (rest, PARTS[place:]))
        falls = [one.error(more) - one.error(less) for one in (first, last) for more, less in orders]
        parts[name] = float(np.mean(falls))
    parts["missing"] = 0.5 * (first.error(()) - last.error(()) + first.error(PARTS) - last.error(PARTS))
    parts["unexplained"] = aligned - noise
    steps, of_aligned = (tuple(one.held_out(which) for one in seen) for which in ((), PARTS))
    return Budget(first.error(()), aligned, first.error(PARTS), floor, parts, steps, of_aligned), Judged(first, last)


def held_out(case: Case, view: View, effects: Sequence[Effect]) -> HeldOut:
    """Errors of effects on frames at the poses as given, and the floor with everything aligned."""
    one = Aligned(case, view, tuple(effects))
    return replace(one.held_out(), floor=one.floor())
