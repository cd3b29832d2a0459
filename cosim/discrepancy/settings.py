"""The numbers that decide in the loop, each with its unit; those of one step stand together.

They were chosen on drives of town02, which no benchmark uses, unless a source is named.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

Pair = tuple[float, float]
Six = tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class Beams:
    """Which beams may be compared, and how points are sorted onto beams."""

    same_m: float = 1.0  # between ranges of what is taken for one surface
    jump_m: float = 0.1  # beyond a plane, from which a neighbour makes an edge
    jump_share: float = 0.01  # of the range, on top of it
    crease_m: float = 0.015  # the same of an edge that moves with a shift of what makes it
    crease_share: float = 0.002
    most_firings: int = 24  # that an edge may be away
    most_rings: int = 4  # that an edge may be away
    apart: float = 0.3  # of the brighter reflectance, by which materials are told apart: three times a noise of 10 %
    directions: int = 8  # in which something thin beside a beam is looked for
    grazing: float = 0.02  # cosine of incidence below which a beam runs along a surface rather than to it
    brightest: float = 1.001  # above which intensities are bytes
    most_points: float = 0.99  # share of a scan's points that must lie below
    first_scans: int = 3  # that are asked for it
    aside_rad: float = 1e-5  # from the middle of its slot, beyond which a point says its own azimuth
    at_once: float = 1.75  # azimuth steps within which returns of a ring have no firing between them
    half_slot: float = 0.5001  # azimuth steps from a firing's azimuth, farther than which no point belongs to it
    agrees_m: float = 0.5  # from the twin, within which a point agrees with it
    agrees_unsaid_m: float = 3.0  # the same where beams are recovered from the order of the points
    fewest_share: float = 0.35  # of points that must agree
    upright: float = 0.5  # |n·z| of what stands on the ground
    fewest_upright: int = 300  # beams on it
    fewest_standing: float = 0.5  # share of these that must agree
    fewest_scans: int = 3  # of which the spread of pose errors tells anything


@dataclass(frozen=True)
class Sampling:
    """Which frames are fitted and which judge, and which beams of them are taken."""

    segment: int = 3  # frames next to each other that do the same
    map_scans: int = 24  # of a map made of the scans that are fitted, evenly spread
    map_judges: int = 8  # that judge
    scans_each: int = 6  # of each map that are fitted where there are several
    judges_each: int = 3  # that judge
    apart: int = 6  # scans from one that is fitted to the next there: so near that they see the same surfaces
    as_far: float = 0.9  # of the farthest way in so many scans: such a stretch next to a map's middle is looked at
    most_beams: int = 4_300_000  # of all scans of maps that are looked at; each takes a kilobyte
    cell_m: float = 5.0  # of the static world
    sky_rad: float = 0.1  # of azimuth, a sector of the sky
    odd_share: float = 0.3  # of a sample at most, for beams that return from where nothing is
    edge_share: float = 0.25  # of the chance of other beams, that beams at edges are taken with: they tell less
    rare_share: float = 0.2  # of a sample, for materials that few beams meet
    lone_share: float = 0.25  # of a sample, for returns that tell of the sensor alone
    looks: int = 16  # at each surface of a map: more tell hardly more than more surfaces would
    margin_m: float = 0.3  # along a beam from a surface of a map, within which a return is its,
    across_m: float = 0.03  # further across it, by which beams that graze it may be bent,
    across_sigmas: float = 4.0  # and scatters of its points: what stands on the ground is off by more
    on_plane_m: float = 0.02  # across it, within which a traced hit is
    neighbours: int = 6  # surfaces about a hit that are asked whether it lies on them
    place_m: float = 8.0  # squares of the ground by whose surfaces findings are judged
    judge_every: int = 3  # one of so many squares
    least_rough: float = 0.2  # of the scatter of points about a surface, that it has itself
    level: float = 0.9  # |n·z| of what lies flat


@dataclass(frozen=True)
class Law:
    """The likelihood of a beam."""

    range_floor_m: float = 5e-4  # spread that no model falls below
    intensity_floor: float = 0.002  # the same of intensities
    rise_sigma_m: float = 0.003  # of a point above its beam
    stray_share: float = 1e-5  # of beams that return from elsewhere
    reference_share: float = 1e-4  # of spurious returns at which their score is taken: smaller shares are irrelevant
    reach_m: float = 120.0  # over which these are spread evenly
    neither_share: float = 0.01  # of beams near edges that return from anywhere, and of lost ones, to begin with
    neither_known: float = 1e-5  # to which these are found
    lost_share: float = 1e-3  # least chance of a return, and of none
    clear_of_limits: float = 2.5  # standard deviations from a limit at which noise is hardly ever cut off
    own_at_seams: float = 0.5  # chance that brightness is a beam's own beside another material
    cut_at_seams: float = 0.1  # chance of a limit there, if it is not
    most_squared: float = 100.0  # of a residual in standard deviations, for spreads
    far_off: float = 3.0  # standard deviations from which a residual's curvature is that which its pull has
    median_size: float = 0.6745  # of a standard normal deviate
    steepest_m_per_rad: float = 300.0  # change of range per angle up to which it is taken as linear


@dataclass(frozen=True)
class Unsure:
    """What is merely not known: random effects."""

    pose_shift_m: float = 0.02  # spread of pose errors that a fit starts from
    pose_turn_rad: float = 9e-4  # the same of turns
    variance_sigmas: float = 3.0  # standard errors that a variance must be above 0 to be kept
    free_poses: Six = (0.2, 0.2, 0.2, 0.01, 0.01, 0.01)  # [m, rad] where a map made of the scans tells nothing of them
    free_map_m: float = 1.0  # the same of its surfaces
    free_albedo: float = 30.0  # and their reflectances: what is dimmed to a tenth has ten times its own
    darkest: float = 0.1  # share of the stated reflectance
    least_poses: Six = (3e-4, 3e-4, 3e-4, 2e-5, 2e-5, 2e-5)  # [m, rad] below which there is none; so the next three
    least_objects: tuple[float, float, float] = (1e-3, 1e-3, 3e-4)  # [m, m, rad]
    least_map_m: float = 1e-3
    least_albedo: float = 3e-3  # share
    probes: int = 12  # random vectors of which traces are the mean
    most_step: float = 30.0  # times that a variance may change in one update
    fewest_parts: int = 16  # of all scans, into which few are divided so that they make clusters
    same_surface: float = 0.5  # share of its range by which a beam may be bent away on a surface
    flattest: float = 0.5  # share of the slope between a beam and its plane that must outlive a turn
    edge_sigmas: float = 3.5  # standard deviations of pose and object errors by which edges are widened
    least_chance: float = 1e-3  # that a beam meets the other side, from which that is looked at
    widest_m: float = 0.15  # to which they are
    widest_rad: float = 2e-3  # the same of turns
    sharp_m: float = 2e-3  # of poses and objects, below which edges are as sharp as they were traced
    sharp_rad: float = 1e-4  # the same of turns


@dataclass(frozen=True)
class Descent:
    """Gauss–Newton steps."""

    gain: float = 0.05  # log-likelihood that a step must still bring
    steps: int = 12  # at most
    halvings: int = 5  # of a step
    ridge: float = 1e-6  # share of their information, a prior of coefficients of dependences
    brightnesses: Six = (0.3, 0.7, 0.95, 1.05, 1.4, 3.0)  # times what a surface of a map has, that are tried a step
    least_told: float = 1e-5  # of what would be known laser by laser without random effects; less is not told at all
    rounds: int = 3  # of tracing anew where beams were bent
    turned_rad: float = 7e-4  # by how much a beam may have turned from where it was traced
    shifted_m: float = 0.02  # and been shifted
    far_m: float = 3.0  # residual beyond which nothing is told of it
    fine_m: float = 0.01  # to which ranges are widened at last
    rough: float = 8.0  # spreads beyond which residuals are far off
    rough_share: float = 0.985  # of beams that are not


@dataclass(frozen=True)
class Search:
    """Parameters that no slope tells of, and intervals of them."""

    reach: float = 0.6  # of a search to both sides: of the value,
    reach_steps: float = 25.0  # and of its natural step
    grid: int = 13  # values at once where the likelihood has steps
    zooms: int = 8  # times that they are drawn together
    near: float = 2e-3  # of the reach, to which a value is found
    roughly: float = 2e-2  # the same to tell candidates apart
    blurred: float = 0.02  # of a value, beyond which it is looked at closer
    aside: float = 6.0  # times that a closer look goes to each side
    few: float = 0.01  # share of beams that are too few for a slope
    altogether: float = 0.5  # chance of a return that a small change takes away where there are steps
    elsewhere_m: float = 0.5  # from a surface to another
    fall: float = float(np.log(20))  # of the log-likelihood at the ends of an interval with steps
    smooth_fall: float = 1.92  # the same without
    passes: int = 6  # over parameters that make up for each other
    enough: float = 0.01  # log-likelihood that one must still bring
    farthest: float = 12.0  # passes at once along a valley
    doublings: int = 24  # towards the ends of an interval,
    bisections: int = 10  # and back
    redoublings: int = 20  # towards the ends of an interval as clusters are drawn anew
    most_coupled: float = 0.995  # two parameters
    edges: int = 360  # azimuths at which sectors begin and end
    fine: int = 200  # between two of them
    least_sector: float = 0.005  # of all beams
    most_sector: float = 0.95  # of all beams
    draws: int = 400  # of clusters with replacement
    side: int = 8  # values to each side that are looked at
    at_ends: float = 0.04  # share of draws that may end where values do
    level_to: float = 1e-12  # relative, between log-likelihoods that are the same
    like_parabola: float = 0.98  # share of the variance of a smooth likelihood


@dataclass(frozen=True)
class Dictionary:
    """Bins of covariates, and where to look for surroundings."""

    bins: int = 10  # of a covariate; equal numbers of beams in each
    fine_bins: int = 30  # of a covariate in a refit
    cyclic_bins: int = 36  # of an angle in a refit
    fewest_in_bin: int = 150  # informative beams in a bin
    fewest_in_cell: int = 60  # the same in a bin of two covariates, or of a spread
    fewest_values: int = 4  # distinct values of a covariate
    object_reach_m: float = 80.0  # horizontal distance of objects that are looked at
    object_far_m: float = 12.0  # distance from objects beyond which all distances are one bin
    retro_reach: int = 32  # firings from a reflector
    speed: float = 0.01  # [m/s] resolution
    acceleration: float = 0.01  # [m/s²] resolution
    yaw_rate: float = 1e-3  # [rad/s] resolution
    power: float = 0.84  # deviate that 80 % power adds to a critical value, the 80 % quantile of a normal distribution


@dataclass(frozen=True)
class Selection:
    """Choice of hypotheses."""

    draws: int = 800  # sign patterns
    level: float = 0.02  # family-wise error rate of adding a term: several are looked for
    confirm_gain: float = 20.0  # log-likelihood from which a term is fitted even where random signs do not decide
    confirm_draws: int = 1999  # sign patterns about its fit
    folds: int = 8  # of clusters, for gains
    sectors: int = 6  # parts of a scan that are clusters
    chunk: int = 400  # columns that are projected at a time
    kept: int = 8  # groups of each channel that a first pass keeps
    least_left: float = 1e-3  # share of a group's information that must outlive what is fitted
    fewest_events: float = 5.0  # expected losses below which one loss more is no evidence
    least_gain: float = 3.0  # log-likelihood of a first term,
    least_follower: float = 5.0  # and of later ones
    steps: int = 8  # terms at most
    listed: int = 12  # remaining dependences that are listed
    rivals: int = 5  # of a best group that are refitted
    rival_share: float = 0.4  # of its gain that these must have
    simpler: float = 0.04  # share of the best exact gain that a simpler group may lack
    named: float = 0.1  # share that an effect of the catalogue may lack
    shared_share: float = 0.1  # of the largest gain of its family that a shared error must reach
    inexact: float = 1e-3  # share of the largest gain to which no fit in bins is exact
    follower_share: float = 0.01  # of the largest gain so far that a follower must reach


@dataclass(frozen=True)
class Quantization:
    """Steps that values stand on; pairs are of ranges [m] and intensities."""

    clear: float = 0.9  # mean cosine of values that count as multiples of a step
    clearer: float = 0.25  # share of the model's distance from a lattice that measured values may have
    finest: Pair = (1e-3, 2e-3)  # steps that are looked for
    coarsest: Pair = (1.0, 0.5)
    most: Pair = (130.0, 1.0)  # values beyond which nothing is looked at
    stored: Pair = (1e-5, 1e-6)  # to which values are written
    padded: int = 4  # times that a spectrum is finer than its values
    fewest: int = 500  # values


@dataclass(frozen=True)
class Settings:
    """All of them, those of each step under its name."""

    rows: int = 30_000  # beams of a sample; more make a diagnosis slower, and hardly surer, as clusters decide
    level: float = 0.05  # family-wise error rate of every test; the convention of the field
    coverage: float = 0.95  # of intervals
    near: float = 1.02  # times its floor, within which an error is at it,
    negligible: float = 0.001  # and of a scale beyond that
    at_floor: float = 0.05  # share by which an aligned error may be above: poses and objects are never fitted exactly
    compare_rows: int = 12_000  # beams by which a comparison estimates what is missing,
    compare_steps: int = 2  # and terms
    most_aligned: int = 12  # frames of a comparison of which it is asked where the error comes from
    beams: Beams = field(default_factory=Beams)
    sampling: Sampling = field(default_factory=Sampling)
    law: Law = field(default_factory=Law)
    unsure: Unsure = field(default_factory=Unsure)
    descent: Descent = field(default_factory=Descent)
    search: Search = field(default_factory=Search)
    dictionary: Dictionary = field(default_factory=Dictionary)
    quantization: Quantization = field(default_factory=Quantization)
    selection: Selection = field(default_factory=Selection)

    @property
    def held_out_rows(self) -> int:
        """Beams of a sample of held-out frames."""
        return self.rows // 2

    @property
    def upper(self) -> float:
        """Where intervals end above, as a quantile."""
        return (1 + self.coverage) / 2

    @property
    def covered(self) -> str:
        """The coverage of intervals in words."""
        return f"{100 * self.coverage:g} %"


DEFAULT = Settings()
