"""The numbers that decide in the loop, each with its unit; those of one step stand together.

They were chosen on drives of town02, which no benchmark uses, unless a source is named.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

Six = tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class Beams:
    """Which beams may be compared, and how points are sorted onto beams.

    Attributes:
        same_m: between ranges of what is taken for one surface.
        jump_m, jump_share: beyond a plane, and of the range, from which a neighbour makes an edge.
        crease_m, crease_share: the same of an edge that moves with a shift of what makes it.
        most_firings, most_rings: that an edge may be away.
        apart: difference of reflectances of the brighter one that tells materials apart: three times a noise of 10 %.
        directions: in which something thin beside a beam is looked for.
        grazing: cosine of incidence below which a beam runs along a surface rather than to it.
        brightest, most_points, first_scans: above what this share of a scan's points lies, intensities are bytes, as
            so many scans tell.
        aside_rad: from the middle of its slot, beyond which a point says its own azimuth.
        at_once: azimuth steps; returns of a ring that are nearer to each other have no firing between them.
        half_slot: azimuth steps; farther from a firing's azimuth no point belongs to it.
        agrees_m, agrees_unsaid_m: from the twin, with beams said or recovered; `fewest_share` of points must.
        upright: |n·z| of what stands on the ground; `fewest_upright` beams on it, of which `fewest_standing` agree.
        fewest_scans: of which the spread of pose errors tells anything.
    """

    same_m: float = 1.0
    jump_m: float = 0.1
    jump_share: float = 0.01
    crease_m: float = 0.015
    crease_share: float = 0.002
    most_firings: int = 24
    most_rings: int = 4
    apart: float = 0.3
    directions: int = 8
    grazing: float = 0.02
    brightest: float = 1.001
    most_points: float = 0.99
    first_scans: int = 3
    aside_rad: float = 1e-5
    at_once: float = 1.75
    half_slot: float = 0.5001
    agrees_m: float = 0.5
    agrees_unsaid_m: float = 3.0
    fewest_share: float = 0.35
    upright: float = 0.5
    fewest_upright: int = 300
    fewest_standing: float = 0.5
    fewest_scans: int = 3


@dataclass(frozen=True)
class Sampling:
    """Which frames are fitted and which judge, and which beams of them are taken.

    Attributes:
        segment: frames next to each other that do the same.
        fewest_confirmed: frames of which a segment can be spared for the end.
        map_scans, map_judges: of a map made of the scans that are fitted and that judge, evenly spread.
        scans_each, judges_each: of each map where there are several.
        apart: scans from one that is fitted to the next there: so near that they see the same surfaces, from elsewhere.
        most_beams: of all scans of maps that are looked at; each takes a kilobyte.
        cell_m, sky_rad: size of a cell of the static world, and of a sector of the sky.
        odd_share: of a sample at most, for beams that return from where nothing is.
        rare_share: of a sample, for materials that few beams meet.
        lone_share: of a sample, for returns that tell of the sensor alone.
        looks: at each surface of a map: more tell hardly more than more surfaces would.
        margin_m, on_plane_m: across a surface of a map, within which a return is its, and a traced hit.
        neighbours: surfaces about a hit that are asked whether it lies on them.
        place_m, judge_every: squares of the ground, one of so many of which judges.
        least_rough: of the scatter of points about a surface, that it has itself.
        level: |n·z| of what lies flat.
    """

    segment: int = 3
    fewest_confirmed: int = 16
    map_scans: int = 24
    map_judges: int = 8
    scans_each: int = 6
    judges_each: int = 3
    apart: int = 6
    most_beams: int = 4_300_000
    cell_m: float = 5.0
    sky_rad: float = 0.1
    odd_share: float = 0.3
    rare_share: float = 0.2
    lone_share: float = 0.25
    looks: int = 16
    margin_m: float = 0.3
    on_plane_m: float = 0.02
    neighbours: int = 6
    place_m: float = 8.0
    judge_every: int = 3
    least_rough: float = 0.2
    level: float = 0.9


@dataclass(frozen=True)
class Law:
    """The likelihood of a beam.

    Attributes:
        range_floor_m, intensity_floor: spreads that no model falls below.
        rise_sigma_m: of a point above its beam.
        stray_share: of beams that return from elsewhere, with a density even over `reach_m`.
        lost_share: least chance of a return, and of none.
        clear_of_limits: standard deviations from a limit at which noise is hardly ever cut off.
        own_at_seams, cut_at_seams: chance that brightness is a beam's own beside another material, and of a limit.
        most_squared: of a residual in standard deviations, for spreads.
        far_off: standard deviations from which a residual's curvature is that which its pull has.
        median_size: of a standard normal deviate.
    """

    range_floor_m: float = 5e-4
    intensity_floor: float = 0.002
    rise_sigma_m: float = 0.003
    stray_share: float = 1e-5
    reach_m: float = 120.0
    lost_share: float = 1e-3
    clear_of_limits: float = 2.5
    own_at_seams: float = 0.5
    cut_at_seams: float = 0.1
    most_squared: float = 100.0
    far_off: float = 3.0
    median_size: float = 0.6745


@dataclass(frozen=True)
class Unsure:
    """What is merely not known: random effects.

    Attributes:
        pose_shift_m, pose_turn_rad: spread of pose errors that a fit starts from.
        variance_sigmas: standard errors that a random effect's variance must be above 0 to be kept.
        free_poses: spreads [m, rad] where a map made of the scans tells nothing of poses.
        free_map_m, free_albedo: the same of its surfaces; what is dimmed to a tenth has ten times its reflectance.
        darkest: share of the stated reflectance.
        least_poses, least_objects, least_map_m, least_albedo: spreads below which there is none [m, rad, share].
        probes: random vectors of which traces are the mean.
        most_step: times that a variance may change in one update.
        fewest_parts: of scans, into which few are divided so that they make clusters.
        same_surface: share of its range by which a beam may be bent away on a surface.
        flattest: share of the slope between a beam and its plane that must outlive a turn.
        edge_sigmas: standard deviations of pose and object errors by which edges are widened.
        widest_m, widest_rad: to which they are.
        sharp_m, sharp_rad: spreads of poses and objects below which edges are as sharp as they were traced.
    """

    pose_shift_m: float = 0.02
    pose_turn_rad: float = 9e-4
    variance_sigmas: float = 3.0
    free_poses: Six = (0.2, 0.2, 0.2, 0.01, 0.01, 0.01)
    free_map_m: float = 1.0
    free_albedo: float = 30.0
    darkest: float = 0.1
    least_poses: Six = (3e-4, 3e-4, 3e-4, 2e-5, 2e-5, 2e-5)
    least_objects: tuple[float, float, float] = (1e-3, 1e-3, 3e-4)
    least_map_m: float = 1e-3
    least_albedo: float = 3e-3
    probes: int = 12
    most_step: float = 30.0
    fewest_parts: int = 16
    same_surface: float = 0.5
    flattest: float = 0.5
    edge_sigmas: float = 3.5
    widest_m: float = 0.15
    widest_rad: float = 2e-3
    sharp_m: float = 2e-3
    sharp_rad: float = 1e-4


@dataclass(frozen=True)
class Descent:
    """Gauss–Newton steps.

    Attributes:
        gain: log-likelihood that a step must still bring.
        steps, rough_steps, halvings: at most; the second of a candidate.
        rounds: of tracing anew where beams were bent.
        turned_rad, shifted_m: by how much a beam may have moved from where it was traced.
        far_m, fine_m: residuals beyond which nothing is told of them, and to which ranges are widened at last.
        rough, rough_share: spreads beyond which residuals are far off, and the share of beams that are not.
    """

    gain: float = 0.05
    steps: int = 12
    rough_steps: int = 10
    halvings: int = 5
    rounds: int = 3
    turned_rad: float = 7e-4
    shifted_m: float = 0.02
    far_m: float = 3.0
    fine_m: float = 0.01
    rough: float = 8.0
    rough_share: float = 0.985


@dataclass(frozen=True)
class Search:
    """Parameters that no slope tells of, and intervals of them.

    Attributes:
        reach, reach_steps: of a search to both sides: of the value, and of its natural step.
        grid, zooms: values at once, and how often they are drawn together, where the likelihood has steps.
        near, roughly: of the reach, to which a value is found.
        blurred, aside: of a value; and how many times that a closer look goes aside.
        few: share of beams that are too few for a slope; `altogether` is the chance that they are lost by.
        elsewhere_m: from a surface to another.
        fall, smooth_fall: of the log-likelihood at the ends of an interval, with steps and without.
        passes, enough: over parameters that make up for each other, and what one must still bring.
        farthest: passes at once along a valley.
        doublings, redoublings, bisections: towards the ends of an interval, the second as clusters are drawn anew.
        most_coupled: parameters at most.
        edges, fine: azimuths at which sectors begin and end, and between two of them.
        least_sector, most_sector: of all beams.
        draws: of clusters with replacement; `side` values to each side are looked at.
        at_ends: share of draws that may end where values do.
        level_to: relative, between log-likelihoods that are the same.
        like_parabola: share of the variance of a smooth likelihood.
        plainly: half widths of its interval from which an amplitude is no matter of doubt.
    """

    reach: float = 0.6
    reach_steps: float = 25.0
    grid: int = 13
    zooms: int = 8
    near: float = 2e-3
    roughly: float = 2e-2
    blurred: float = 0.02
    aside: float = 6.0
    few: float = 0.01
    altogether: float = 0.5
    elsewhere_m: float = 0.5
    fall: float = float(np.log(20))
    smooth_fall: float = 1.92
    passes: int = 6
    enough: float = 0.01
    farthest: float = 12.0
    doublings: int = 24
    redoublings: int = 20
    bisections: int = 10
    most_coupled: float = 0.995
    edges: int = 360
    fine: int = 200
    least_sector: float = 0.005
    most_sector: float = 0.95
    draws: int = 400
    side: int = 8
    at_ends: float = 0.04
    level_to: float = 1e-12
    like_parabola: float = 0.98
    plainly: float = 15.0


@dataclass(frozen=True)
class Screen:
    """What is asked for, and how it is tested.

    Attributes:
        draws: sign patterns of a wild bootstrap; 1999 tell p to 0.0005.
        bins: of a covariate; equal numbers of beams in each.
        fewest_in_bin: beams; fewer tell nothing of a bin.
        fewest_values: that a covariate has.
        speed, acceleration, yaw_rate: steps [m/s, m/s², rad/s] that are told apart; who drives straight on turns.
        degree, main_degree: of smooth functions of pairs, and of each covariate beside these.
        hump: standard deviations about 0 in which residuals are counted; of `fewest_residuals` at least.
        least_noise_m, least_noise: spreads of ranges and intensities that tell of noise.
        most_strays: of all beams: of few a form that tells of many would say that there are none.
        slowest: waves a revolution below which it is a dependence on azimuth.
        wave_draws, wave_fine: sign patterns of periodograms; frequencies about a line that are looked at.
        looks: at the same data (Bonferroni).
        chunk: columns that are projected at a time.
        plain: standard deviations beyond which sums by cluster grow as their logarithms.
        left: share of information below which nothing outlives what is fitted, to rounding.
        most_times, times: a weak form that would just be seen, and its inverse, are looked for in so many steps.
        power: deviate that 80 % power adds to a critical value, the 80 % quantile of a normal law.
    """

    draws: int = 1999
    bins: int = 10
    fewest_in_bin: int = 150
    fewest_values: int = 4
    speed: float = 0.01
    acceleration: float = 0.01
    yaw_rate: float = 1e-3
    degree: int = 2
    main_degree: int = 4
    hump: float = 0.4
    fewest_residuals: int = 2000
    least_noise_m: float = 3e-3
    least_noise: float = 5e-3
    most_strays: float = 1e-4
    slowest: int = 8
    wave_draws: int = 499
    wave_fine: int = 81
    looks: int = 2
    chunk: int = 400
    plain: float = 3.0
    left: float = 1e-9
    most_times: float = 100.0
    times: int = 93
    power: float = 0.84


@dataclass(frozen=True)
class Lattices:
    """Steps that values stand on; pairs are of ranges [m] and intensities.

    Attributes:
        clear: mean cosine of values that count as multiples of a step.
        clearer: share of the model's distance from a lattice that measured values may have.
        finest, coarsest: steps that are looked for.
        most: values beyond which nothing is looked at.
        stored: to which values are written.
        padded: times that a spectrum is finer than its values.
        fewest: values.
    """

    clear: float = 0.9
    clearer: float = 0.25
    finest: tuple[float, float] = (1e-3, 2e-3)
    coarsest: tuple[float, float] = (1.0, 0.5)
    most: tuple[float, float] = (130.0, 1.0)
    stored: tuple[float, float] = (1e-5, 1e-6)
    padded: int = 4
    fewest: int = 500


@dataclass(frozen=True)
class Pick:
    """What is fitted and tried.

    Attributes:
        fitted: catalogue effects that are fitted a round, the best by foreseen gain.
        nearly: share of the best candidate's foreseen gain from which another one is fitted, too.
        tried: candidates a round, until one helps.
        alike_sigmas: standard errors of a difference of gains below which two candidates cannot be told apart.
        clear: standard errors by which a shape must explain more than an effect.
        few_numbers: of effects that go first on a map made of the scans.
        of_ranges, of_others: candidates of a channel that are fitted there.
        shapes: dependences of a channel that are solved a round.
        much: of what an effect explains, that a simpler one must explain by itself.
        strengths: times a weak form, from which a fit starts.
        unexplained: that are listed at most.
    """

    fitted: int = 4
    nearly: float = 0.4
    tried: int = 4
    alike_sigmas: float = 1.0
    clear: float = 2.0
    few_numbers: int = 2
    of_ranges: int = 4
    of_others: int = 2
    shapes: int = 2
    much: float = 0.5
    strengths: Six = (1.0, 5.0, 25.0, -1.0, -5.0, -25.0)
    unexplained: int = 12


@dataclass(frozen=True)
class Shapes:
    """Shapes of unknown dependences, and their formulas.

    Attributes:
        bins, pair_bins, phase_bins: of a covariate, of each of two, and of a phase.
        fewest: beams in a bin of two.
        steps, settled: of a solution; and of a standard error, within which it is there.
        most_lost: of a prediction that a shape may take away.
        formulas, sure: that a shape over scans is chosen from, about; and the chance at which it is told.
        regular: of the time between scans, by which it may vary in a regular drive.
        grid, centres, widths: values of shape parameters that are tried.
        harmonics: of what comes round.
    """

    bins: int = 40
    pair_bins: int = 12
    phase_bins: int = 24
    fewest: int = 20
    steps: int = 6
    settled: float = 0.1
    most_lost: float = 0.9
    formulas: int = 300
    sure: float = 0.01
    regular: float = 0.1
    grid: int = 25
    centres: int = 60
    widths: int = 32
    harmonics: int = 4


@dataclass(frozen=True)
class Settings:
    """All of them.

    Attributes:
        rows: beams of a sample; more make a diagnosis slower, and hardly surer, as clusters decide.
        level: family-wise error rate of every test; the convention of the field.
        coverage: of intervals.
        most_findings: effects and unknowns that are added at most.
        near, negligible: times its floor, and of a scale beyond it, within which an error is at the floor.
        at_floor: the same share of an aligned error: poses and objects are never fitted exactly.
        most_aligned: frames of a comparison of which it is asked where the error comes from.
    """

    rows: int = 30_000
    level: float = 0.05
    coverage: float = 0.95
    most_findings: int = 8
    near: float = 1.02
    negligible: float = 0.001
    at_floor: float = 0.05
    most_aligned: int = 12
    beams: Beams = field(default_factory=Beams)
    sampling: Sampling = field(default_factory=Sampling)
    law: Law = field(default_factory=Law)
    unsure: Unsure = field(default_factory=Unsure)
    descent: Descent = field(default_factory=Descent)
    search: Search = field(default_factory=Search)
    screen: Screen = field(default_factory=Screen)
    lattices: Lattices = field(default_factory=Lattices)
    pick: Pick = field(default_factory=Pick)
    shapes: Shapes = field(default_factory=Shapes)

    @property
    def upper(self) -> float:
        """Where intervals end above, as a quantile."""
        return (1 + self.coverage) / 2


DEFAULT = Settings()
