"""What is said of drivers, to as many digits as is known."""

from cosim.driver_discrepancy.diagnosis import TrafficFinding
from cosim.driver_discrepancy.sentences import parameter_words


def _finding(ci95: dict[str, list[float]]) -> TrafficFinding:
    return TrafficFinding(
        behaviour="lane_offset",
        params={"lat_alignment_m": 0.1997, "lat_dev_m": 6.85e-9},
        before={"lat_alignment_m": 0.0, "lat_dev_m": 0.0},
        ci95=ci95,
        p_value=1e-4,
        error_before=1.4,
        error_after=0.5,
        also_possible=(),
        shown_by={},
    )


def test_values_have_the_digits_of_their_intervals():
    found = _finding({"lat_alignment_m": [0.1737, 0.2257], "lat_dev_m": [0.0, 0.0205]})
    assert parameter_words(found) == "lat_alignment_m 0.200 m ± 0.026, lat_dev_m 0.000 m ± 0.010"


def test_a_value_without_an_interval_stands_by_itself():
    assert parameter_words(_finding({})) == "lat_alignment_m 0.2 m, lat_dev_m 6.85e-09 m"
