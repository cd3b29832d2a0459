"""The dictionary of hypotheses: channels × covariates, effects, waves, lines and class means."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.dictionary.covariates import SampleCovariate, constant, sample_covariates
from cosim.discrepancy.dictionary.groups import Group, is_tested
from cosim.discrepancy.dictionary.linearisation import Linearisation
from cosim.discrepancy.dictionary.objects import object_groups
from cosim.discrepancy.dictionary.periodic import line_groups, wave_groups
from cosim.discrepancy.settings import Settings

_PAIRS = (
    ("block", "frame_time"), ("azimuth", "elevation"), ("range", "incidence"), ("range", "intensity"),
    ("ring", "range"), ("azimuth", "frame_time"), ("elevation", "frame_time"),
)  # fmt: skip
_WAVES = ("range", "azimuth_error", "elevation_error")
_LINES = (*_WAVES, "intensity", "drop")
_COARSE, _COARSEST = 5, 3  # bins of each covariate of a pair; of those crossed with rings


@dataclass(frozen=True, eq=False)
class Dictionary:
    """All hypotheses that are tested.

    Attributes:
        covariates: covariates by name, including pairs.
        explicit: groups that are not bins of a covariate: effects, waves, lines, class means.
        tested: number of tested groups.
    """

    covariates: dict[str, SampleCovariate]
    explicit: list[Group]
    tested: int


def build_dictionary(
    linearisation: Linearisation, effects: Sequence[Group], settings: Settings, rng: np.random.Generator
) -> Dictionary:
    """Generate all hypotheses of a linearisation.

    Args:
        linearisation: linearised fit.
        effects: tangents of the catalogue.
        settings: numeric choices.
        rng: random generator for the reference distributions of lines.
    """
    sample = linearisation.sample
    found = [constant(sample), *sample_covariates(sample, linearisation.fitted.prediction, linearisation.frames)]
    covariates = {covariate.name: covariate for covariate in found}
    for first, second in _PAIRS:
        if first in covariates and second in covariates:
            of_rings = "ring" in (first, second)
            bins = _COARSEST if of_rings else _COARSE
            pair = covariates[first].coarse(bins).crossed(covariates[second].coarse(bins))
            covariates[pair.name] = pair
    explicit = list(effects)
    for channel in linearisation.channels:
        if channel in _WAVES and len(sample.names) > 2:
            explicit += wave_groups(linearisation, channel)
        if channel in _LINES:
            level = settings.level / (2 * len(_LINES))
            explicit += line_groups(linearisation, channel, settings.selection.draws, level, rng)
    explicit += object_groups(linearisation)
    binned = sum(
        is_tested(channel, covariate) for channel in linearisation.channels for covariate in covariates.values()
    )
    return Dictionary(covariates, explicit, binned + len(explicit))
