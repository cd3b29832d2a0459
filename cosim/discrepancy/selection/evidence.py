"""Evidence in the scores about a model: every hypothesis tested, and which are significant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from cosim.discrepancy.dictionary.build import Dictionary, build_dictionary
from cosim.discrepancy.dictionary.groups import Group
from cosim.discrepancy.dictionary.linearisation import Linearisation, linearise
from cosim.discrepancy.dictionary.shared_errors import shared_errors
from cosim.discrepancy.inference.projection import PART, Projector
from cosim.discrepancy.selection.first_pass import first_pass
from cosim.discrepancy.selection.refit import FittedModel
from cosim.discrepancy.selection.table import Entry, GroupTest, evaluate, score_groups, score_shared
from cosim.discrepancy.settings import Settings


@dataclass(frozen=True, eq=False)
class SelectionEvidence:
    """Evidence in the scores about a model.

    Attributes:
        linearisation: of the model.
        dictionary: all hypotheses.
        results: of those that the first pass kept, the largest gain first.
        rejected: names of groups whose exact refits gain no more than chance.
        exact_gains: log-likelihoods that exact refits of groups gained, by name, as far as they were made.
    """

    linearisation: Linearisation
    dictionary: Dictionary
    results: list[GroupTest]
    rejected: frozenset[str] = frozenset()
    exact_gains: dict[str, float] = field(default_factory=dict)

    def tested_like(self, entry: Entry) -> int:
        """Number of hypotheses for which a p-value has to allow.

        Effects that are tested on the random effects are few: they share half of the level.
        """
        if not entry.is_of_random:
            return self.dictionary.tested
        return 2 * sum(result.group.is_effect and result.group.size == 1 for result in self.results)

    def significant(self, settings: Settings) -> list[GroupTest]:
        """Results at or below the level that gain something on clusters that took no part."""
        least = settings.selection.least_gain
        level = settings.selection.level
        return [
            result
            for result in self.results
            if result.p_value <= level and result.gain >= least and result.group.name not in self.rejected
        ]

    def candidates(self, settings: Settings) -> list[GroupTest]:
        """Significant results, and those that gain so much that their own fit has to decide."""
        by, significant = settings.selection, self.significant(settings)
        uncertain = [
            result
            for result in self.results
            if result.gain >= by.confirm_gain and not result.group.is_shared and not result.group.is_count
        ]
        names = {result.group.name for result in significant}
        both = [*significant, *(result for result in uncertain if result.group.name not in names)]
        return sorted(both, key=lambda result: -result.gain)


def gather_evidence(model: FittedModel, effects: Sequence[Group], settings: Settings, seed: int) -> SelectionEvidence:
    """Linearise about a model and test every hypothesis.

    Args:
        model: fitted.
        effects: tangents of catalogue effects.
        settings: numeric choices.
        seed: of signs and folds.
    """
    rng, by = np.random.default_rng([seed, len(model.terms)]), settings.selection
    linearisation = linearise(model.fitter, model.fitted, model.frames)
    dictionary = build_dictionary(linearisation, effects, settings, rng)
    projectors = _projectors(linearisation, by.sectors)
    kept = first_pass(linearisation, dictionary, projectors, settings)
    of_scans = _projectors(linearisation, 1) if any(group.is_of_scan for group in kept) else projectors
    entries: list[Entry] = []
    for family in projectors:
        for is_of_scan, own in ((False, projectors[family]), (True, of_scans[family])):
            groups = [group for group in kept if group.family == family and group.is_of_scan == is_of_scan]
            entries += score_groups(linearisation, groups, own, by)
    shared = shared_errors(linearisation)
    # Two displaced surfaces correlate only the beams of units that hit both: clusters are single objects and map cells.
    clusters = linearisation.sample.track, projectors["range"].clusters[PART]
    entries += score_shared(linearisation, shared, model.shared, clusters, by.folds)
    tested = dictionary.tested + len(shared)
    results = evaluate(entries, by, rng, max(tested / max(len(entries), 1), 1.0))
    return SelectionEvidence(linearisation, dictionary, results)


def _projectors(linearisation: Linearisation, sectors: int) -> dict[str, Projector]:
    """Projectors by family of channels: intensities and returns have the same clusters."""
    of_reflectances = linearisation.projector(sectors, "intensity")
    return {"range": linearisation.projector(sectors), "intensity": of_reflectances, "returns": of_reflectances}
