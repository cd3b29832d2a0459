"""Once all is found: what was found first is looked at again beside the rest, and what does nothing goes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cosim.discrepancy.inference.fit import all_free
from cosim.discrepancy.inquiry import Inquiry, Look, Model
from cosim.discrepancy.revising import is_idle, redrawn, simpler_rival
from cosim.discrepancy.settling import Settled
from cosim.discrepancy.unknown import Shape, shape_effect
from sensors.effects.base import Effect

_CLEARLY_THERE = 5.0


def parted(case: Inquiry, shape: Shape) -> Settled:
    """The unknown shape about zero: a constant error beside it is a candidate of the next round."""
    place, case.unknown = case.unknown_place(), shape.without_level()
    assert place is not None  # it has just been added
    case.model = replace(case.model, effects=case.with_effect(place, shape_effect(case.unknown)))
    settled = case.fitted_anew()
    case.errors[-1] = case.held_out()
    return settled


def revised(case: Inquiry, look: Look) -> Look:
    """What was found first, looked at again beside all the rest."""
    if len(case.findings) + (case.unknown is not None) < 2:
        return look
    for number, finding in enumerate(case.findings):
        place = next(i for i, effect in enumerate(case.model.effects) if effect.name == finding.effect)
        rival = simpler_rival(look.fitter, look.fitted, place, case.kinds)
        anew = _exchanged(case, look, place, rival) if rival is not None else None
        if rival is not None and anew is not None:
            look, case.findings[number] = anew, replace(finding, effect=rival.name)
    place = case.unknown_place()
    if case.unknown is None or place is None:
        return look
    shape = redrawn(look.fitter, look.fitted, place, case.unknown)
    if shape is None or shape.is_like(case.unknown):
        case.unknown = shape or case.unknown
        return look
    anew = _exchanged(case, look, place, shape_effect(shape))
    case.unknown = shape if anew is not None else case.unknown
    return anew or look


def _exchanged(case: Inquiry, look: Look, place: int, effect: Effect) -> Look | None:
    """With another effect in a place, unless frames that took no part are told worse by it."""
    case.say(f"{effect.name} in place of {case.model.effects[place].name}")
    before = case.model, case.frames
    case.model = replace(case.model, effects=case.with_effect(place, effect))
    settled, after = case.fitted_anew(), case.held_out()
    if case.errors[-1].beats(after):
        case.model, case.frames = before
        return None
    case.errors[-1] = after
    return replace(look, fitter=settled.fitter, fitted=settled.fitted)


def tidied(case: Inquiry, look: Look) -> Look:
    """Take out, or put back as it was said, what turned out to do nothing once the others were there.

    One by one, the least needed first: of two that make up for one another each does nothing beside the other.
    """
    before = look
    while idle := _idle(case, look):
        least = idle[0] if len(idle) == 1 else max(idle, key=lambda place: _worth_without(case, look, place))
        case.say(f"taking out {case.model.effects[least].name}")
        case.findings = [one for one in case.findings if one.effect != case.model.effects[least].name]
        case.model = _without(case, least)
        settled = case.fitted_anew()
        look = replace(look, fitter=settled.fitter, fitted=settled.fitted)
    if look is not before:
        case.errors.append(case.held_out())
    return look


def _idle(case: Inquiry, look: Look) -> list[int]:
    """Places of effects that do nothing beside the others, or what they were said to do."""
    fitter, fitted = look.fitter, look.fitted
    places = [place for place in case.model.fitted if case.model.effects[place] != case.said(place)]
    return [place for place in places if is_idle(fitter, fitted, place, _CLEARLY_THERE, said=case.said(place))]


def _without(case: Inquiry, place: int) -> Model:
    """The model without an effect, or with it as it was said, which is fitted no more."""
    effects, said = dict(enumerate(case.model.effects)), case.said(place)
    if said is None:
        del effects[place]
    else:
        effects[place] = said
    kept = sorted(effects)
    places = tuple(kept.index(one) for one in case.model.fitted if one != place)
    return Model(tuple(effects[one] for one in kept), places)


def _worth_without(case: Inquiry, look: Look, place: int) -> float:
    """Log-likelihood of the others fitted without an effect, and what its numbers cost."""
    model, fitted = _without(case, place), look.fitted
    free = all_free(model.effects, model.fitted, look.fitter.rings)
    rest = look.fitter.fit(model.effects, free, pose=fitted.pose, pose_sigma=fitted.pose_sigma, near=model.fitted)
    count = sum(one.unknown.rings for one in fitted.free_of(place))
    return rest.loglik + count * float(np.log(len(look.fitter.sample))) / 2
