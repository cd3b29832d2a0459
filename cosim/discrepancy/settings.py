"""Numeric settings of the discrepancy loop, grouped by step.

Units are in the names (`_m`, `_rad`, `_sigma…`); `_share` is a fraction from 0 to 1. The values were tuned on drives of
town02, which no benchmark uses, unless a source is given.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

Pair = tuple[float, float]
Six = tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class BeamSampling:
    """Assignment of points to beams, and selection of the beams that are compared."""

    same_m: float = 1.0  # maximum difference between two ranges to the same surface
    jump_m: float = 0.1  # distance of a neighbour's hit from the plane of a beam that makes an edge,
    jump_share: float = 0.01  # plus this share of the range
    crease_m: float = 0.015  # the same for creases: edges that move if the surface that makes them is shifted
    crease_share: float = 0.002  # the same share of the range for creases
    most_firings: int = 24  # maximum distance of an edge, in firings
    most_rings: int = 10  # maximum distance of an edge, in rings
    apart: float = 0.3  # relative difference of reflectance that distinguishes materials: three times a noise of 10 %
    directions: int = 8  # number of directions around a beam in which thin objects are searched,
    distances: int = 12  # and number of distances in each: a rail of 1 cm may lie anywhere within the tolerance
    nearby_rings: int = 2  # largest distance in rings,
    nearby_firings: int = 8  # and in firings, of a beam that may have hit the surface of a neighbour near an edge,
    nearby_m: float = 0.3  # and largest difference of their ranges, plus `jump_share` of the range
    grazing: float = 0.02  # cosine of incidence below which a beam is nearly parallel to the surface
    brightest: float = 1.001  # intensities above this are bytes
    most_points: float = 0.99  # quantile of a scan's intensities that is compared with it
    first_scans: int = 3  # number of scans in which it is checked
    aside_rad: float = 1e-5  # azimuth offset from the nominal firing above which a point keeps its own azimuth
    at_once: float = 1.75  # azimuth steps; returns of a ring closer than this have no firing between them
    half_slot: float = 0.5001  # azimuth steps; a point further from the nearest firing belongs to no beam
    agrees_m: float = 0.5  # distance within which a point agrees with the twin
    agrees_unsaid_m: float = 3.0  # the same if beams are recovered from the order of the points
    fewest_share: float = 0.35  # minimum share of points that must agree
    upright: float = 0.5  # |n·z| of a normal n below which a surface is upright
    fewest_upright: int = 300  # minimum number of beams on upright surfaces for this check
    fewest_standing: float = 0.5  # minimum share of these that must agree
    fewest_scans: int = 3  # minimum number of scans to estimate the variance of pose errors


@dataclass(frozen=True)
class Sampling:
    """Split into frames for fitting and for validation, and sampling of their beams."""

    segment: int = 3  # consecutive frames that belong to the same part of the split
    map_scans: int = 24  # scans of one map (made from the scans) used for fitting, evenly spaced
    map_validation_scans: int = 12  # scans of one map used for validation
    scans_each: int = 6  # scans per map used for fitting, if there are several maps
    validation_scans_each: int = 3  # scans per map used for validation, if there are several maps
    apart: int = 6  # length of the stretch of fitted scans over their number: close enough to see the same surfaces
    as_far: float = 0.9  # share of the longest distance travelled in such a stretch that the chosen stretch must reach
    most_beams: int = 4_300_000  # maximum number of beams in all scans of maps; each takes about 1 kB of memory
    cell_m: float = 5.0  # cell size of the static world
    sky_rad: float = 0.1  # azimuth width of a sector of the sky
    odd_share: float = 0.3  # maximum share of a sample for returns where the twin has no surface
    edge_share: float = 0.25  # sampling probability of beams at edges relative to others: they are less informative
    rare_share: float = 0.2  # share of a sample reserved for rare materials
    firing_share: float = 0.2  # share of a sample in firings that are sampled as a whole, for errors common to a firing
    lone_share: float = 0.25  # share of a sample for returns that can only be used for the sensor's calibration
    beams_per_surface: int = 16  # maximum number of beams per map surface: more beams add less than more surfaces do
    margin_m: float = 0.3  # distance along the beam within which a return belongs to a map surface,
    across_m: float = 0.03  # plus this distance along the normal (for beams at grazing incidence),
    across_sigmas: float = 4.0  # plus this many σ of its points; objects on the ground are further away
    on_plane_m: float = 0.02  # distance along the normal within which a traced hit belongs to a map surface
    neighbours: int = 6  # number of nearest surfaces tested for a hit
    least_rough: float = 0.2  # minimum share of the scatter of a surface's points that is attributed to its roughness
    level: float = 0.9  # |n·z| of a normal n above which a surface is horizontal


@dataclass(frozen=True)
class LikelihoodConstants:
    """Likelihood of a beam."""

    range_floor_m: float = 5e-4  # minimum σ of ranges
    intensity_floor: float = 0.002  # minimum σ of intensities
    rise_sigma_m: float = 0.003  # σ of a point's offset perpendicular to its beam
    least_spurious_share: float = 1e-5  # share of beams with spurious returns beyond those that effects predict
    reference_share: float = 1e-4  # share of spurious returns at which their score is evaluated
    reach_m: float = 120.0  # spurious returns are uniform up to this range
    unknown_scales_m: Pair = (0.1, 1.0)  # scales of the distance of unknown surfaces from the sides of an edge
    least_outside_share: float = 1e-4  # minimum share of beams near edges with a return from before all surfaces
    least_neither_share: float = 1e-5  # minimum share of beams near edges that hit no known surface, of each kind
    edge_octaves_m: Pair = (5.0, 160.0)  # range of distances whose octaves have their own shares
    lost_share: float = 1e-3  # minimum probability of a return, and of no return
    clear_of_limits: float = 2.5  # distance from a limit, in σ, beyond which censoring is negligible
    own_at_seams: float = 0.5  # probability that an intensity is from the beam's own surface next to another material
    cut_at_seams: float = 0.1  # probability density at a limit if it is from the other surface
    most_squared: float = 100.0  # cap on squared residuals (in σ²) in scores of variances
    far_off: float = 3.0  # residuals above this many σ get the curvature of iteratively reweighted least squares
    median_size: float = 0.6745  # median absolute value of a standard normal variable
    steepest_m_per_rad: float = 300.0  # maximum derivative of range by angle that is treated as linear


@dataclass(frozen=True)
class RandomEffectSettings:
    """Random effects: errors of poses, objects, map and reflectances."""

    pose_shift_m: float = 0.02  # initial σ of pose errors: shifts,
    pose_turn_rad: float = 9e-4  # and rotations
    variance_sigmas: float = 3.0  # a variance is kept if it exceeds 0 by this many standard errors
    free_poses: Six = (0.2, 0.2, 0.2, 0.01, 0.01, 0.01)  # [m, rad] σ of flat priors on own maps: poses,
    free_map_m: float = 1.0  # positions of map surfaces,
    free_albedo: float = 30.0  # and their relative reflectances (a factor of 10 is possible)
    darkest: float = 0.1  # minimum factor on the stated reflectance
    least_poses: Six = (3e-4, 3e-4, 3e-4, 2e-5, 2e-5, 2e-5)  # [m, rad] a smaller σ counts as 0; also in the next three
    least_objects: tuple[float, float, float] = (1e-3, 1e-3, 3e-4)  # [m, m, rad]
    least_map_m: float = 1e-3  # σ
    least_albedo: float = 3e-3  # relative
    probes: int = 12  # random vectors for stochastic trace estimates
    most_step: float = 30.0  # maximum factor by which a variance changes in one update
    dependent_cells: int = 9  # side of the squares of map cells whose position errors may depend on each other,
    reflectance_cells: int = 3  # the same for errors of reflectances,
    fewest_squares: int = 30  # and number of squares below which they are made smaller
    fewest_parts: int = 16  # minimum number of clusters: fewer scans are divided into sectors
    same_surface: float = 0.5  # maximum relative change of the range of a deflected beam on the same surface
    flattest: float = 0.5  # minimum share of n·d of a beam and its plane that remains after a rotation
    edge_sigmas: float = 3.5  # edges are widened by this many σ of pose, object and map errors,
    least_chance: float = 1e-3  # minimum probability of hitting the other side of an edge to be considered
    widest_m: float = 0.15  # but at most by this shift,
    widest_rad: float = 2e-3  # and this rotation
    sharp_m: float = 2e-3  # σ of shifts below which edges are not widened
    sharp_rad: float = 1e-4  # σ of rotations below which edges are not widened


@dataclass(frozen=True)
class Descent:
    """Gauss–Newton iterations."""

    gain: float = 0.05  # minimum gain in log-likelihood per step
    rough_gain: float = 1e-4  # and relative to that of all steps before, to rank candidates
    steps: int = 80  # maximum number of steps
    few_steps: int = 8  # with an inflated σ, and until the most likely start is chosen
    ridge: float = 1e-6  # precision of the prior of dependences' coefficients, as a share of their information
    brightnesses: Pair = (0.95, 1.05)  # trial factors on the albedo of a map surface in each step
    min_identified_share: float = (
        1e-5  # minimum share of information of per-laser parameters with random effects eliminated
    )
    rounds: int = 3  # maximum number of times the beams are traced again after they were deflected
    turned_rad: float = 7e-4  # maximum rotation of beams since they were traced
    shifted_m: float = 0.02  # maximum shift of beams since they were traced
    far_m: float = 3.0  # larger residuals are ignored
    fine_m: float = 0.01  # smallest additional σ of graduated fits
    rough: float = 8.0  # residuals above this many σ are large
    rough_share: float = 0.985  # quantile of residuals that is compared with it


@dataclass(frozen=True)
class Search:
    """Line search for parameters without useful derivatives, and their intervals."""

    reach: float = 0.6  # half width of the search range: this share of the value,
    reach_steps: float = 25.0  # or this many natural steps, if that is more
    grid: int = 13  # number of grid values if the likelihood has jumps
    zooms: int = 8  # number of grid refinements
    near: float = 2e-3  # tolerance as a share of the search range
    roughly: float = 2e-2  # the same to rank candidates
    blurred: float = 0.02  # tolerance relative to the value above which a second, closer search follows
    aside: float = 6.0  # half width of the closer search, in tolerances
    few: float = 0.01  # share of beams below which a derivative is not used
    altogether: float = 0.5  # change of the return probability per step above which the likelihood has jumps
    elsewhere_m: float = 0.5  # change of range that means another surface
    fall: float = float(np.log(20))  # fall of the log-likelihood at the ends of an interval, with jumps
    smooth_fall: float = 1.92  # the same without jumps
    passes: int = 6  # maximum number of passes over parameters that compensate each other
    enough: float = 0.01  # minimum gain in log-likelihood per pass
    farthest: float = 12.0  # maximum extrapolation along a valley, in passes
    doublings: int = 24  # maximum number of doublings to bracket the ends of an interval,
    bisections: int = 10  # and number of bisections
    redoublings: int = 20  # maximum number of doublings of the bootstrap grid
    most_coupled: float = 0.995  # maximum correlation of two parameters
    edges: int = 360  # number of azimuths at which sectors may start and end
    fine: int = 200  # refinement steps between two of them
    least_sector: float = 0.005  # minimum share of beams in a sector
    most_sector: float = 0.95  # maximum share of beams in a sector
    draws: int = 400  # number of bootstrap draws
    side: int = 8  # grid values to each side in the bootstrap
    at_ends: float = 0.04  # maximum share of draws with the optimum at an end of the grid
    level_to: float = 1e-12  # relative tolerance for equal log-likelihoods
    like_parabola: float = 0.98  # minimum share of variance explained by a parabola for a smooth likelihood


@dataclass(frozen=True)
class DictionarySettings:
    """Bins of covariates, and neighbourhoods of objects and reflectors."""

    bins: int = 10  # bins of a covariate, with equal numbers of beams
    fine_bins: int = 30  # bins of a covariate in a refit
    cyclic_bins: int = 36  # bins of an angle in a refit
    scans_in_bin: int = 4  # scans per bin of what all beams of a scan have in common, such as the speed
    fewest_in_bin: int = 150  # minimum number of informative beams in a bin
    fewest_in_cell: int = 60  # minimum number in a bin of two covariates, or of a variance
    fewest_values: int = 4  # minimum number of distinct values of a covariate
    object_reach_m: float = 80.0  # maximum horizontal distance of objects that are considered
    object_far_m: float = 12.0  # distance from objects above which there is one bin
    retro_reach: int = 32  # maximum distance from a retroreflector, in firings
    speed: float = 0.01  # [m/s] resolution
    acceleration: float = 0.01  # [m/s²] resolution
    yaw_rate: float = 1e-3  # [rad/s] resolution
    power: float = 0.84  # z added to the critical value for 80 % power (the 80 % quantile of a normal distribution)


@dataclass(frozen=True)
class Selection:
    """Selection of terms (effects and dependences)."""

    draws: int = 800  # random sign patterns of the test
    level: float = 0.02  # family-wise error rate of adding a term: several terms are tested
    confirm_gain: float = 20.0  # gain in log-likelihood above which a term is fitted even without a decisive sign test
    folds: int = 8  # folds of clusters in cross-validated gains
    sectors: int = 6  # parts of a scan that are clusters
    chunk: int = 400  # columns that are projected at a time
    kept: int = 8  # groups per channel that pass the first screening
    least_left: float = 1e-3  # share of a column's information below which it is a rounding error of the derivatives
    fewest_events: float = 5.0  # minimum expected number of dropped returns for one more to count as evidence
    least_gain: float = 3.0  # minimum gain in log-likelihood of the first term,
    least_follower: float = 5.0  # and of later terms
    steps: int = 16  # maximum number of terms
    listed: int = 12  # maximum number of remaining dependences listed
    rivals: int = 5  # number of alternatives to the best group that are refitted
    rival_share: float = 0.4  # minimum gain of these relative to the best group
    simpler: float = 0.04  # maximum relative loss of gain of a simpler group that is preferred
    named: float = 0.1  # maximum relative loss of gain of a catalogue effect that is preferred
    shared_share: float = 0.1  # minimum gain of a shared error relative to the largest gain of its family
    inexact: float = 1e-3  # share of the largest gain of a binned term to which no fit in bins is exact
    follower_share: float = 0.01  # minimum gain of a later term relative to the largest gain so far


@dataclass(frozen=True)
class Quantization:
    """Detection of rounding steps; pairs are for ranges [m] and intensities."""

    clear: float = 0.9  # minimum mean cosine of the phases of values that are multiples of a step
    clearer: float = 0.25  # maximum ratio of the measured to the predicted distance from the lattice
    finest: Pair = (1e-3, 2e-3)  # smallest steps tested
    coarsest: Pair = (1.0, 0.5)  # largest steps tested
    most: Pair = (130.0, 1.0)  # larger values are ignored
    stored: Pair = (1e-5, 1e-6)  # resolution of stored values
    padded: int = 4  # zero-padding factor of the spectrum
    fewest: int = 500  # minimum number of values


@dataclass(frozen=True)
class Settings:
    """All settings; those of each step are in one attribute."""

    rows: int = 30_000  # beams per sample; more cost time and add little precision, as the number of clusters decides
    level: float = 0.05  # family-wise error rate of each test (the usual convention)
    coverage: float = 0.95  # coverage of intervals
    near: float = 1.02  # an error up to this multiple of its floor counts as at the floor,
    negligible: float = 0.001  # plus this share of its scale
    at_floor: float = 0.05  # relative excess of an aligned error that counts as at its floor: alignment is never exact
    compare_rows: int = 12_000  # beams per sample in `compare`, which estimates the missing part,
    compare_steps: int = 2  # and the maximum number of terms there
    most_aligned: int = 12  # maximum number of frames to fit, and of held-out frames, for the budget in `compare`
    beams: BeamSampling = field(default_factory=BeamSampling)
    sampling: Sampling = field(default_factory=Sampling)
    likelihood: LikelihoodConstants = field(default_factory=LikelihoodConstants)
    random_effects: RandomEffectSettings = field(default_factory=RandomEffectSettings)
    descent: Descent = field(default_factory=Descent)
    search: Search = field(default_factory=Search)
    dictionary: DictionarySettings = field(default_factory=DictionarySettings)
    quantization: Quantization = field(default_factory=Quantization)
    selection: Selection = field(default_factory=Selection)

    @property
    def held_out_rows(self) -> int:
        """Beams of a sample of held-out frames."""
        return self.rows // 2

    @property
    def upper(self) -> float:
        """Upper quantile of two-sided intervals."""
        return (1 + self.coverage) / 2

    @property
    def covered(self) -> str:
        """Coverage of intervals as text."""
        return f"{100 * self.coverage:g} %"


DEFAULT = Settings()
