"""What is left of the findings once all is known: simplified, removed where superfluous, drawn anew, confirmed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cosim.discrepancy.inference.comparison import Gain, gain
from cosim.discrepancy.inference.intervals import deviations, plainly_on
from cosim.discrepancy.select import Candidate, reshaped, simpler_than
from cosim.discrepancy.state import Case, Found, Model, State, View, fitted_anew, given, judged, seen_by, viewed


def simplified(case: Case, state: State) -> State:
    """With a simpler effect in place of each finding that says no more than it, now that everything else is known.

    What was found first had to explain some of what was found later, too. On a map made of the scans effects of few
    numbers went first anyway.
    """
    if len(state.found) < 2 or state.view.fitter.sample.of_own_map:
        return state
    for one in state.found:
        place = state.model.place_of(one.effect)
        if place is None or one.shape is not None or one.interval is not None or place < len(given(case)):
            continue
        case.say(f"asking whether something simpler does as well as {one.effect}")
        simpler = simpler_than(case, state, place)
        if simpler is not None:
            renamed = replace(one, effect=simpler.name, told_by=simpler.told_by)
            kept = tuple(renamed if other is one else other for other in state.found)
            state = _with_candidate(case, state, simpler, kept)
    return state


def eliminated(case: Case, state: State) -> State:
    """Without findings that others have made superfluous: removed one by one, the rest fitted anew."""
    if len(state.found) < 2:
        return state
    sure = plainly_on(state.view.fitter, state.view.fitted, given(case))
    for one in reversed(state.found[:-1]):
        place = state.model.place_of(one.effect)
        if place is None or one.interval is not None or place in sure:
            continue
        case.say(f"asking whether {one.effect} is still needed")
        less, view = _reduced(case, state, place)
        if view.fitter is not state.view.fitter:
            continue
        told = gain(view.fitter, view.fitted, state.view.fitted, one.told_by)
        value = told.value if one.told_by == "noise" else state.view.fitted.loglik - view.fitted.loglik
        if told.p_value > case.settings.level or value < np.log(len(view.fitter.sample)):
            state = _moved_on(case, state, less, view, _all_but(one, state))
            sure = plainly_on(state.view.fitter, state.view.fitted, given(case))
    return state


def redrawn(case: Case, state: State) -> State:
    """With shapes of unknown dependences as they are beside everything else that was found."""
    if len(state.found) < 2:
        return state
    for one in [one for one in state.found if one.shape is not None]:
        case.say(f"drawing {one.effect} anew")
        found = reshaped(state, one)
        if found is None:
            continue
        shape, better = found
        if shape is None:
            state = _without(case, state, one)
            continue
        kept = tuple(replace(other, shape=shape) if other is one else other for other in state.found)
        state = replace(state, found=kept) if better is None else _with_candidate(case, state, better, kept)
    return state


def assured(case: Case, state: State) -> State:
    """Without findings that may be nothing: their intervals hold it, and a model without them is hardly less likely."""
    sizes = deviations(state.view.fitter, state.view.fitted, given(case)) if state.found else {}
    for one in state.found:
        place = state.model.place_of(one.effect)
        if place is None or one.is_fact or sizes.get(place, 1.0) >= 1.0:
            continue
        case.say(f"asking whether {one.effect} is anything")
        less, view = _reduced(case, state, place)
        lost = state.view.fitted.loglik - view.fitted.loglik
        if view.fitter is state.view.fitter and lost < np.log(len(view.fitter.sample)):
            return assured(case, _moved_on(case, state, less, view, _all_but(one, state)))
    return state


def confirmed(case: Case, state: State) -> State:
    """Without what a segment denies that nothing was fitted, chosen or judged by until now."""
    if state.found and case.split.confirm:
        case.say("asking the untouched segment")
    while (one := contradicted(case, state, Model(given(case)))) is not None:
        state = _without(case, replace(state, struck=(*state.struck, one)), one)
    return state


def contradicted(case: Case, state: State, given: Model) -> Found | None:
    """The finding that the untouched segment is told best without; None where it confirms all, or there is none.

    Each finding is taken out alone, the others as they are; random effects alone are fitted. Facts of the file and of
    the very scans that were fitted are not asked for: other scans cannot deny them.

    Args:
        case, state: of the diagnosis.
        given: the model as it was before anything was found.
    """
    asked = [one for one in state.found if not one.is_fact]
    if not case.split.confirm or not asked:
        return None
    view = viewed(case, case.split.confirm, Model(state.model.effects), case.settings.judging_rows)
    told = [(one, _gain(view, state.model, one, given)) for one in asked]
    for one, found in told:
        case.say(f"{one.effect} gains {found.value:.1f} ± {found.error:.1f} on the untouched segment")
    worst, found = min(told, key=lambda row: row[1].value)
    return worst if found.value < 0 else None


def _gain(view: View, model: Model, one: Found, given: Model) -> Gain:
    """What a finding gains on the frames of a view, over the model without it."""
    place = model.place_of(one.effect)
    assert place is not None  # found
    before = seen_by(view, model.without(place, given.effects).effects)
    return gain(view.fitter, before, view.fitted, one.told_by)


def _without(case: Case, state: State, one: Found) -> State:
    """The rest fitted anew without a finding."""
    place = state.model.place_of(one.effect)
    assert place is not None  # found
    return _moved_on(case, state, *_reduced(case, state, place), _all_but(one, state))


def _reduced(case: Case, state: State, place: int) -> tuple[Model, View]:
    """The model without the effect of a place, and as it is fitted anew."""
    less = state.model.without(place, given(case))
    return less, fitted_anew(case, less, state.view)


def _with_candidate(case: Case, state: State, one: Candidate, found: tuple[Found, ...]) -> State:
    """With the model of a candidate, fitted anew from where it stands."""
    view = fitted_anew(case, one.model, replace(state.view, fitted=one.fitted))
    return _moved_on(case, state, one.model, view, found)


def _moved_on(case: Case, state: State, model: Model, view: View, found: tuple[Found, ...]) -> State:
    """With another model, as it was fitted in a view, and what judging frames say of it; not screened yet."""
    model = replace(model, effects=view.fitted.effects)
    return replace(state, model=model, view=view, judges=judged(case, state.judges, model), found=found, screened=[])


def _all_but(one: Found, state: State) -> tuple[Found, ...]:
    return tuple(other for other in state.found if other is not one)
