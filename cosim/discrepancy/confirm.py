"""The last look: frames by which nothing was fitted, chosen or judged confirm findings or strike them out."""

from __future__ import annotations

from cosim.discrepancy.inference.comparison import Gain, gain
from cosim.discrepancy.state import Case, Found, Model, State, View, seen_by, viewed
from sensors.effects.base import NoiseEffect


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
    view = viewed(case, case.split.confirm, Model(state.model.effects), case.settings.rows // 2)
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
    return gain(view.fitter, before, view.fitted, of_noise=isinstance(model.effects[place], NoiseEffect))
