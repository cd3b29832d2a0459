"""The matrix of cases: what is hidden, how strongly, in which town."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np

from tests.hidden import base_drives
from tests.hidden.amplitudes import STRENGTHS, has_level, parameters
from tests.hidden.drive import Hidden
from tests.hidden.nuisances import NUISANCES
from tests.hidden.physics import told
from tests.hidden.truth import Told
from tests.hidden.unknowns import KINDS, draw_two
from tests.hidden.unnamed import UNNAMED

NULLS = ("null", "null_nuisance", "null_harder", "nuisance")
NAMED = ("strong", "one", "half", "quarter", "several", "disturbed")
TWO = "two_at_once"
UNKNOWNS = ("unnamed", *KINDS, TWO)
GROUPS = (*NULLS, *NAMED, *UNKNOWNS)
LEVELS = ("strong", "half")  # of unknown effects
_DRAWS = 2  # of each kind and level
_NULL_DRAWS = 3
_SINGLE_NUISANCES = tuple(name for name in NUISANCES if name not in ("usual", "harder"))
_NUISANCE_LAWS = ("student5", "laplace")
_PEOPLED = "town01_s2"  # elsewhere hardly anybody is on foot
_KNOWN = {
    "dual_block": {"upper_m": 0.0405, "lower_m": -0.0405},
    "sweep_motion": {"sweep_s": 0.1},
    "glass_transmission": {"transmission": 0.85, "mode": "strongest"},
    "incidence_falloff": {"exponent": 0.5},
    "random_dropout": {"probability": 0.05},
}
_SEVERAL = (
    ("range_walk", "incidence_falloff"),
    ("elevation_offset", "range_bias"),
    ("sweep_motion", "ring_range_offset"),
    ("atmospheric_extinction", "random_dropout"),
    ("incidence_bias", "range_scale"),
    ("dual_block", "encoder_eccentricity"),
    ("ring_gain", "range_falloff"),
    ("suspension_pitch", "max_range"),
    ("range_walk", "elevation_offset", "backscatter"),
    ("mount_rotation", "ring_gain", "random_dropout"),
    ("sweep_motion", "glass_transmission", "range_bias"),
    ("range_noise", "incidence_falloff", "false_alarms"),
    ("incidence_bias", "detection_threshold", "ring_elevation"),
)
_DISTURBED = (
    ("range_walk", ("label_jitter_track", "pose_drift")),
    ("elevation_offset", ("pose_drift",)),
    ("incidence_bias", ("map_error",)),
    ("range_bias", ("label_jitter_frame", "heavy_tails")),
    ("ring_range_offset", ("outliers", "label_jitter_track")),
    ("incidence_falloff", ("label_jitter_track", "map_error")),
    ("range_walk", ("harder",)),
    ("ring_gain", ("harder",)),
)
_QUICK = (
    "null-plain-exact", "null-known-exact", "null_nuisance-0-usual", "null_harder-0-harder", "nuisance-pose_drift",
    "strong-range_walk-", "strong-elevation_offset-", "strong-incidence_falloff-", "strong-random_dropout-",
    "half-range_walk-", "half-range_bias-", "several-range_walk+incidence_falloff-",
    "several-sweep_motion+ring_range_offset-", "unnamed-azimuth_step_strong-", "unnamed-dirty_window_strong-",
    *(f"{kind}-strong0-" for kind in (*KINDS, TWO)),
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """One drive to be diagnosed.

    Attributes:
        name: group, what is hidden, whether nuisances are on (`exact`, `usual`, `harder`), seed.
        group: of `GROUPS`.
        hidden: what is hidden.
        base, held_out: names of base drives: the one to be diagnosed, and one the diagnosis never sees.
        level: of an unknown effect: `strong` or `half`.
    """

    name: str
    group: str
    hidden: Hidden
    base: str
    held_out: str
    level: str = ""

    @property
    def is_quick(self) -> bool:
        """Part of the quick matrix."""
        return self.name.startswith(_QUICK) and self.name.endswith("-0")

    @property
    def is_exact(self) -> bool:
        """Nothing is wrong with twin and noise."""
        return not self.hidden.nuisances and self.hidden.range_law == self.hidden.intensity_law == "gaussian"

    @property
    def told(self) -> list[Told]:
        """What is true of the unknown effects."""
        return [told(name, parameters) for name, parameters in self.hidden.unnamed.items()]


def all_cases(seeds: Iterable[int], frames: int) -> list[Case]:
    """Every case of some seeds, in an order that shows something of every group early."""
    found = [case for seed in seeds for case in _Seed(seed, frames).cases()]
    rank = {case.name: zlib.crc32(case.name.encode()) for case in found}
    return sorted(found, key=lambda case: (not case.is_quick, rank[case.name]))


def spread(cases: list[Case], count: int) -> list[Case]:
    """As many cases, taken from each group in turn, in the cases' order."""
    waiting: dict[str, list[Case]] = {}
    for case in cases:
        waiting.setdefault(case.group, []).append(case)
    turns = [case for row in zip_longest(*waiting.values()) for case in row if case is not None]
    chosen = {case.name for case in turns[:count]}
    return [case for case in cases if case.name in chosen]


@dataclass(frozen=True)
class _Seed:
    """The cases of one seed."""

    seed: int
    frames: int

    def cases(self) -> Iterator[Case]:
        yield from self._nulls()
        yield from self._named()
        yield from self._unknowns()

    def _nulls(self) -> Iterator[Case]:
        yield self._case("null", "plain", "exact")
        yield self._case("null", "known", "exact", known=_KNOWN)
        yield self._case("null", "without_rays", "exact", rays=False)
        yield self._case("null", "foreign_materials", "exact", foreign=True)
        for draw in range(_NULL_DRAWS):
            yield self._case("null_nuisance", str(draw), "usual")
            yield self._case("null_harder", str(draw), "harder")
        for nuisance in (*_SINGLE_NUISANCES, "outliers", "heavy_tails"):
            yield self._case("nuisance", nuisance, "", nuisances=(nuisance,))
        yield self._case("nuisance", "logistic", "", range_law="logistic", intensity_law="student5")

    def _named(self) -> Iterator[Case]:
        for level in ("strong", "one", "half", "quarter"):
            for name in STRENGTHS:
                if has_level(name, level):
                    yield self._case(level, name, effects=self._drawn((name,), level, name + level))
        turned = self._drawn(("elevation_offset",), "strong", "e")
        yield self._case("strong", "elevation_offset_without_rays", effects=turned, rays=False)
        for names in _SEVERAL:
            yield self._case("several", "+".join(names), effects=self._drawn(names, "strong", "+".join(names)))
        for name, nuisances in _DISTURBED:
            truth = self._drawn((name,), "strong", name + "disturbed")
            what = f"{name}_harder" if "harder" in nuisances else name
            yield self._case("disturbed", what, "", effects=truth, nuisances=nuisances)

    def _unknowns(self) -> Iterator[Case]:
        for name, unnamed in UNNAMED.items():
            for level, values in (("strong", unnamed.strong), ("half", unnamed.half)):
                yield self._case("unnamed", f"{name}_{level}", unnamed={name: dict(values)}, level=level)
        for kind in (*KINDS, TWO):
            for level in LEVELS:
                for draw in range(_DRAWS):
                    rng = self._generator(f"{kind}{level}{draw}")
                    drawn = draw_two(rng, level) if kind == TWO else {kind: KINDS[kind].draw(rng, level)}
                    yield self._case(kind, f"{level}{draw}", unnamed=drawn, known=_losses(drawn), level=level)

    def _case(self, group: str, what: str, nuisance: str | None = None, level: str = "", **hidden) -> Case:
        """A case; `nuisance` None draws whether it has any, an empty one leaves that to `hidden`."""
        rng = self._generator(f"nuisance {group} {what}")
        drawn = ("exact", "usual")[int(rng.integers(2))] if nuisance is None else nuisance
        if drawn in ("usual", "harder"):
            range_law, intensity_law = (str(rng.choice(_NUISANCE_LAWS)) for _ in range(2))
            hidden |= {"nuisances": (drawn,), "range_law": range_law, "intensity_law": intensity_law}
        name = "-".join(part for part in (group, what, drawn, str(self.seed)) if part)
        code = zlib.crc32(name.encode())
        row, step = code % len(base_drives.NAMES), 1 + code // 7 % 2
        if hidden.get("unnamed", {}).get("class_or_material", {}).get("objects") == "people":
            row = base_drives.NAMES.index(_PEOPLED)
        base, held_out = base_drives.NAMES[row], base_drives.NAMES[(row + step) % len(base_drives.NAMES)]
        return Case(name, group, Hidden(seed=code % 100_000, frames=self.frames, **hidden), base, held_out, level)

    def _drawn(self, effects: tuple[str, ...], level: str, key: str) -> dict[str, dict]:
        rng = self._generator(key)
        return {name: parameters(name, level, rng) for name in effects}

    def _generator(self, key: str) -> np.random.Generator:
        return np.random.default_rng([self.seed, zlib.crc32(key.encode())])


def _losses(drawn: Mapping[str, Mapping]) -> dict[str, Mapping]:
    """What the user knows of losses: without any, nothing could follow them."""
    waits = any(name in KINDS and KINDS[name].late(parameters) for name, parameters in drawn.items())
    return {"random_dropout": _KNOWN["random_dropout"]} if waits else {}
