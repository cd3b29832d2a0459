"""The cases of the benchmark: what is hidden, how strongly, where, and with which errors of the twin."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.hidden.amplitudes import STRENGTHS, has_level, parameters
from tests.hidden.base_drives import FRAMES, PATTERNS, TOWNS, Base, base_drive
from tests.hidden.drive import Hidden, world_of
from tests.hidden.truth import Finding
from tests.hidden.twin_files import read_pattern
from tests.hidden.unseen.kind import LEVELS, NotApplicableError, World
from tests.hidden.unseen.registry import FAULTS, FORMS, KINDS

NULL, SINGLE, SEVERAL = "null", "single", "several"
UNSEEN, TWO, BESIDE, FORM = "unseen", "unseen_two", "unseen_catalogue", "form"
UNSEEN_GROUPS = (UNSEEN, TWO, BESIDE, FORM)
GROUPS = (NULL, SINGLE, SEVERAL, *UNSEEN_GROUPS)
# Shares of a sample.
_WEIGHTS = {NULL: 4.0, SINGLE: 4.0, SEVERAL: 3.0, UNSEEN: 6.0, TWO: 1.0, BESIDE: 1.0, FORM: 1.0}
SENSORS: dict[str, dict[str, dict]] = {
    "bare": {},
    "physics": {
        "sweep_motion": {"sweep_s": 0.1},
        "incidence_falloff": {"exponent": 0.5},
        "range_falloff": {"reference_m": 40.0, "exponent": 1.0},
        "random_dropout": {"probability": 0.03},
    },
    "detection": {
        "beam_divergence": {"divergence_mrad": 2.0, "pulse_ns": 6.0},
        "detection_threshold": {"threshold": 0.06, "softness": 0.02},
    },
}
NUISANCES = ("usual", "harder")
_LAWS = ("student5", "laplace")
_NULL_BASES = 4
_DRAWS = {UNSEEN: 2, FORM: 1}  # of each kind
_TWOS, _BESIDES = 6, 6
_MOST_DRAWS = 200
_LOSSES = {"probability": 0.05}
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
# Catalogue effects together with an unseen one, and the channels that both must not share.
_RANGES = ("range", "azimuth_error", "elevation_error", "shared_range", "wiring", "range_variance")
_COMPANIONS: dict[str, tuple[str, ...]] = {
    "range_walk": _RANGES,
    "range_bias": _RANGES,
    "elevation_offset": _RANGES,
    "incidence_bias": _RANGES,
    "encoder_eccentricity": _RANGES,
    "incidence_falloff": ("intensity", "intensity_offset", "intensity_variance", "shared_intensity"),
    "ring_gain": ("intensity", "intensity_offset", "intensity_variance", "shared_intensity"),
    "random_dropout": ("drop", "shared_drop"),
    "backscatter": ("spurious", "early", "late"),
}


@dataclass(frozen=True)
class Case:
    """One drive to be diagnosed.

    Attributes:
        name: group, what is hidden, level, nuisances, seed.
        group: of `GROUPS`.
        effects: names of the hidden catalogue effects.
        kinds: names of the hidden unseen kinds; where a group draws them, none.
        level: of `unseen.kind.LEVELS`; empty for nulls.
        bases: base drives in the order in which they are tried: the first that has what the effect acts on is used.
        sensor: name of the user's sensor file, of `SENSORS`.
        nuisance: of `NUISANCES`.
        frames: number of frames.
        seed: of everything random.
    """

    name: str
    group: str
    effects: tuple[str, ...]
    kinds: tuple[str, ...]
    level: str
    bases: tuple[Base, ...]
    sensor: str
    nuisance: str
    frames: int
    seed: int

    def resolve(self, folder: Path) -> tuple[Path, Hidden]:
        """Draw all parameters: the base drive, and what to hide in it.

        Raises:
            NotApplicableError: no base drive has anything that the effects could act on.
        """
        for base in self.bases:
            drive = base_drive(base, folder)
            try:
                return drive, self._drawn(drive)
            except NotApplicableError:
                continue
        raise NotApplicableError(f"{self.name}: none of {len(self.bases)} drives has what {self.kinds} act on")

    def _drawn(self, drive: Path) -> Hidden:
        rng, rings = np.random.default_rng([self.seed, 11]), len(read_pattern(drive)["elevation_deg"])
        range_law, intensity_law = (str(rng.choice(_LAWS)) for _ in range(2))
        blank = Hidden(
            known=SENSORS[self.sensor],
            nuisances=(self.nuisance,),
            range_law=range_law,
            intensity_law=intensity_law,
            frames=self.frames,
            seed=self.seed,
        )
        effects = {name: parameters(name, self.level, rng, rings) for name in self.effects}
        unseen: dict[str, dict] = {}
        if self.group in UNSEEN_GROUPS:
            world = world_of(drive, blank)
            if self.group == TWO:
                unseen = _draw_two(rng, self.level, world)
            else:
                unseen = {name: KINDS[name].draw(rng, self.level, world) for name in self.kinds}
            if self.group == BESIDE:
                effects = _draw_companion(rng, rings, unseen, world)
        known = {name: p for name, p in blank.known.items() if name not in effects}
        if unseen.get("neighbours", {}).get("look", "").endswith("_lost"):  # without losses nothing could follow them
            known["random_dropout"] = _LOSSES
        return Hidden(**{**vars(blank), "known": known, "effects": effects, "unseen": unseen})


def all_cases(seeds: Iterable[int], frames: int = FRAMES) -> list[Case]:
    """Every case of some seeds, in an order in which any first part has something of everything."""
    cases = [case for seed in seeds for case in _Seed(seed, frames).cases()]
    return sorted(cases, key=lambda case: zlib.crc32(case.name.encode()))


def sample_cases(cases: list[Case], count: int) -> list[Case]:
    """As many cases, spread over the groups by their weights, in the cases' order."""
    waiting: dict[str, list[Case]] = {}
    for case in cases:
        waiting.setdefault(case.group, []).append(case)
    taken = dict.fromkeys(waiting, 0)
    chosen: set[str] = set()
    while len(chosen) < min(count, len(cases)):
        left = [group for group in waiting if taken[group] < len(waiting[group])]
        group = min(left, key=lambda name: (taken[name] + 1) / _WEIGHTS[name])
        chosen.add(waiting[group][taken[group]].name)
        taken[group] += 1
    return [case for case in cases if case.name in chosen]


@dataclass(frozen=True)
class _Seed:
    """The cases of one seed."""

    seed: int
    frames: int

    def cases(self) -> Iterator[Case]:
        yield from self._nulls()
        yield from self._catalogue()
        yield from self._unseen()

    def _nulls(self) -> Iterator[Case]:
        for row, base in enumerate(self._bases(self._generator("null"))[:_NULL_BASES]):
            for sensor in SENSORS:
                for nuisance in NUISANCES:
                    yield self._case(NULL, f"{row}-{sensor}", bases=(base,), sensor=sensor, nuisance=nuisance)

    def _catalogue(self) -> Iterator[Case]:
        for name in STRENGTHS:
            for level in ("strong", "half"):
                if has_level(name, level):
                    yield self._case(SINGLE, name, effects=(name,), level=level)
        for names in _SEVERAL:
            yield self._case(SEVERAL, "+".join(names), effects=names, level="strong")

    def _unseen(self) -> Iterator[Case]:
        for group, types in ((UNSEEN, FAULTS), (FORM, FORMS)):
            for kind in types:
                for draw in range(_DRAWS[group]):
                    yield self._case(group, f"{kind}{draw}", types=(kind,), level=self._level(group, kind, draw))
        for draw in range(_TWOS):
            yield self._case(TWO, str(draw), level=self._level(TWO, "", draw))
        for draw in range(_BESIDES):
            kind = str(self._generator(f"beside{draw}").choice(list(FAULTS)))
            yield self._case(BESIDE, f"{kind}{draw}", types=(kind,), level=self._level(BESIDE, kind, draw))

    def _level(self, group: str, kind: str, draw: int) -> str:
        return str(self._generator(f"level {group} {kind} {draw}").choice(LEVELS))

    def _case(
        self,
        group: str,
        what: str,
        effects: tuple[str, ...] = (),
        types: tuple[str, ...] = (),
        level: str = "",
        bases: tuple[Base, ...] = (),
        sensor: str = "",
        nuisance: str = "",
    ) -> Case:
        rng = self._generator(f"case {group} {what} {level}")
        bases = bases or self._bases(rng)
        if "dual_block" in effects:
            bases = tuple(base for base in bases if base.pattern == "hdl64e")
        sensor = sensor or str(rng.choice(list(SENSORS)))
        nuisance = nuisance or str(rng.choice(NUISANCES))
        name = "-".join(part for part in (group, what, level, nuisance, str(self.seed)) if part)
        code = zlib.crc32(name.encode()) % 100_000
        return Case(name, group, effects, types, level, bases, sensor, nuisance, self.frames, code)

    def _bases(self, rng: np.random.Generator) -> tuple[Base, ...]:
        """The seed's base drives in random order: nine towns, each with one pattern, half of them HDL-64E."""
        of_seed = self._generator("bases")
        patterns = [PATTERNS[0], PATTERNS[1], PATTERNS[0], PATTERNS[2]]
        towns = of_seed.permutation(TOWNS)
        bases = [Base(str(town), patterns[row % 4], self.seed) for row, town in enumerate(towns)]
        return tuple(bases[row] for row in rng.permutation(len(bases)))

    def _generator(self, key: str) -> np.random.Generator:
        return np.random.default_rng([self.seed, zlib.crc32(key.encode())])


def _draw_two(rng: np.random.Generator, level: str, world: World) -> dict[str, dict]:
    """Two unseen effects of different kinds whose correct findings are in different channels."""
    for _ in range(_MOST_DRAWS):
        names = [str(name) for name in rng.choice(list(FAULTS), 2, replace=False)]
        try:
            two = {name: KINDS[name].draw(rng, level, world) for name in names}
        except NotApplicableError:
            continue
        first, second = ({c for f in KINDS[name].truths(p, world) for c in _channels(f)} for name, p in two.items())
        if not first & second:
            return two
    raise NotApplicableError


def _draw_companion(
    rng: np.random.Generator, rings: int, unseen: Mapping[str, Mapping], world: World
) -> dict[str, dict]:
    """A strong catalogue effect in other channels than the unseen ones."""
    findings = [f for name, p in unseen.items() for f in KINDS[name].truths(p, world)]
    used = {channel for finding in findings for channel in _channels(finding)}
    near = {name for finding in findings for name in (*finding.effects, *finding.beside)}
    names = [name for name, channels in _COMPANIONS.items() if not used & set(channels) and name not in near]
    if not names:
        raise NotApplicableError
    name = str(rng.choice(names))
    return {name: parameters(name, "strong", rng, rings)}


def _channels(finding: Finding) -> set[str]:
    return {*finding.channels, *(channel for other in finding.also for channel in _channels(other))}
