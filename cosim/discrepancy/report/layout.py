"""How pages about comparisons and diagnoses are laid out."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Layout:
    """Numbers of pictures and tables; none of them decides what is found."""

    bins: int = 20  # of a covariate; each of a pair has `pair_bins`
    pair_bins: int = 8
    names: int = 8  # of categories in a chart, the most common ones
    fewest: int = 50  # rows in a bin, and in one of a pair `fewest_in_cell`
    fewest_in_cell: int = 30
    sweeps: int = 4  # that take off what each of a pair does alone
    dots: int = 40  # in a chart, more are a line alone
    alike: float = 0.02  # share of the largest size within which charts stand in their usual order
    common: float = 0.02  # share of rows from which a bin takes part in the scale of a chart
    excess: float = 0.05  # share of the excess from which a channel is worth a word
    told: float = 5e-4  # of an error: less is told as 0.000
    unexplained: int = 6  # charts of what is left
    sigmas: float = 4.0  # to which noise is drawn
    values: int = 9  # of an unknown dependence on categories
    scans: int = 3  # shown whole
    beams: int = 60_000  # of each, so that a page stays below 4 MB
    rows: int = 30_000  # of each judging frame in charts
    sectors: int = 12  # of azimuth: what beams of a frame share once its pose is fitted ends there, as objects do
    largest_square: float = 25.0  # of a residual over its spread
    cut_off: float = 3.0  # standard deviations from a limit of intensity


LAYOUT = Layout()
