"""Reflectance and relief stay where they are on their surfaces; weak signals and noise of firings as measured."""

from __future__ import annotations

import numpy as np
import pytest

from assets.materials import material_index
from sensors.effects.expectation import expect
from sensors.effects.spatial_noise import CELLS, field_at
from sensors.returns import Returns
from sensors.scene import Scene
from sensors.sensor_model import SensorModel, load_sensor, points_of
from tests.sensors.effects.scenes import effect, no_model, of_hits, sensor, shoot
from tests.sensors.worlds import plane

ROAD = Scene(plane(), no_model)


def test_the_field_has_unit_variance_and_neighbours_are_equal() -> None:
    grid = np.stack(np.meshgrid(*[np.arange(0, CELLS, 2)] * 3, indexing="ij"), -1).reshape(-1, 3) + 0.5
    values, beside, far = (field_at(grid + step, 1.0) for step in (0.0, [1, 0, 0], [40, 0, 0]))
    assert values.std() == pytest.approx(1, abs=0.02)
    assert np.corrcoef(values, beside)[0, 1] > 0.7
    assert abs(np.corrcoef(values, far)[0, 1]) < 0.3
    np.testing.assert_array_equal(field_at(grid, 1.0), field_at(grid + CELLS, 1.0))  # periodic
    assert abs(np.corrcoef(values, field_at(grid, 1.0, (37, 0, 0)))[0, 1]) < 0.3


def test_reflectance_belongs_to_the_surface_and_not_to_the_beam() -> None:
    """Beams of two lasers that hit the same cell have the same reflectance; the field changes no other channel."""
    kind = effect("reflectance_field", surfaces="ground", sigma=0.5, cell_m=0.5)
    bare, shot = shoot(sensor(), ROAD)
    found, _ = shoot(sensor(kind), ROAD)
    assert np.all(bare.material == material_index("asphalt"))
    np.testing.assert_array_equal(found.intensity, bare.intensity)  # asphalt is road, not ground
    found, shot = shoot(sensor(effect("reflectance_field", surfaces="road", sigma=0.5, cell_m=0.5)), ROAD)
    factor = found.intensity / bare.intensity
    cell = np.floor(shot.points_in_world(found)[:, :2] / 0.5).astype(int)
    order = np.lexsort(cell.T)
    same = (np.diff(cell[order], axis=0) == 0).all(1)
    assert same.sum() > 1000
    gap = np.abs(np.diff(np.log(factor[order])))[same]
    assert np.quantile(gap, 0.95) < 1e-5  # but for places at the edge of a cell
    assert np.log(factor).std() > 0.2
    np.testing.assert_array_equal(found.range_m, bare.range_m)


def test_a_zero_stays_zero_and_neighbours_are_anticorrelated() -> None:
    bare, _ = shoot(sensor(), ROAD)
    found, _ = shoot(sensor(effect("firing_noise", sigma=0.03, theta=1.0, least=0.01)), ROAD)
    noise = found.intensity - bare.intensity
    assert noise.std() == pytest.approx(0.03, rel=0.05)
    following = np.diff(bare.beam) == 1
    assert np.corrcoef(noise[:-1][following], noise[1:][following])[0, 1] == pytest.approx(-0.5, abs=0.03)
    dark = effect("weak_signal", signals=(5.0,) * 64, steepness=8, least=(0.1,) * 64, sigma=0, cell_m=0.1)
    zeros, _ = shoot(sensor(effect("firing_noise", sigma=0.03, theta=1.0, least=0.01), dark), ROAD)
    assert len(zeros) == len(bare)
    assert not zeros.intensity.any()


def test_a_control_that_overshoots_makes_every_other_firing_brighter() -> None:
    """Autocorrelation of an ARMA(1, 1) process; σ is the standard deviation whatever its coefficients."""
    phi, theta, sigma = 0.6, 0.4, 0.01
    bare, _ = shoot(sensor(), ROAD)
    found, _ = shoot(sensor(effect("firing_noise", sigma=sigma, theta=theta, phi=phi, least=0)), ROAD)
    noise = found.intensity - bare.intensity
    assert noise.std() == pytest.approx(sigma, rel=0.03)
    first = -(1 + theta * phi) * (theta + phi) / (1 + theta**2 + 2 * theta * phi)
    for lag, expected in ((1, first), (2, -phi * first)):
        apart = bare.beam[lag:] - bare.beam[:-lag] == lag
        assert np.corrcoef(noise[:-lag][apart], noise[lag:][apart])[0, 1] == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize(
    ("name", "parameters", "column"),
    [
        ("firing_noise", {"sigma": 0.01, "theta": 0, "least": 0}, "intensity"),
        ("range_tail", {"sigma_m": 0.02, "degrees": 90}, "range_m"),
    ],
)
def test_factors_scale_the_noise_of_each_laser(name: str, parameters: dict[str, float], column: str) -> None:
    factors = np.linspace(0.5, 2.0, 64)
    bare, shot = shoot(sensor(), ROAD)
    found, _ = shoot(sensor(effect(name, **parameters, factors=tuple(factors))), ROAD)
    noise = getattr(found, column) - getattr(bare, column)
    ring = shot.rays.ring[bare.beam]
    lasers = np.unique(ring)
    spread = np.array([noise[ring == laser].std() for laser in lasers])
    np.testing.assert_allclose(spread, next(iter(parameters.values())) * factors[lasers], rtol=0.12)
    with pytest.raises(ValueError, match="3 entries"):
        effect(name, **parameters, factors=(1.0,) * 3).check(shot.pattern)


def test_verges_are_rougher_than_pavements_of_the_same_ground() -> None:
    grass, paving = (Scene(plane(material=material), no_model) for material in ("grass", "paving"))
    rough = effect("surface_relief", surfaces="verge", coarse_sigma_m=0.03, coarse_m=0.1, fine_sigma_m=0, fine_m=0.02)
    for scene, height_m in ((grass, 0.03), (paving, 0.0)):
        bare, shot = shoot(sensor(), scene)
        found, _ = shoot(sensor(rough), scene)
        steep = shot.cos_incidence(bare) > 0.2
        raised = ((bare.range_m - found.range_m) * shot.cos_incidence(bare))[steep]
        assert raised.std() == pytest.approx(height_m, rel=0.3)


def test_weak_signals_are_halved_at_the_lasers_signal() -> None:
    bare, _ = shoot(sensor(), ROAD)
    signal = float(bare.intensity[0])
    kind = effect("weak_signal", signals=(signal,) * 64, steepness=8, least=(0.1,) * 64, sigma=0, cell_m=0.1)
    found, _ = shoot(sensor(kind), ROAD)
    np.testing.assert_allclose(found.intensity, bare.intensity / 2, rtol=1e-4)


def test_the_kitti_sensor_stores_millimetres_in_the_order_of_kittis_files() -> None:
    kitti = load_sensor("kitti")
    returns, shot = of_hits(SensorModel(kitti.pattern), ROAD)
    assert isinstance(returns, Returns)
    cloud = points_of(returns, shot).in_file_order()
    np.testing.assert_allclose(cloud.xyz * 1000, np.rint(cloud.xyz * 1000), atol=0.01)
    turn = np.mod(cloud.azimuth, 2 * np.pi)
    assert np.all(np.diff(turn)[np.diff(cloud.ring.astype(int)) == 0] >= 0)


def test_an_unknown_texture_is_a_spread_and_not_a_prediction() -> None:
    """σ of I·exp(σ·f) is I·√(e^{σ²}(e^{σ²} − 1)) over realisations, and each realisation is another field."""
    sigma = 0.3
    model = sensor(effect("reflectance_field", surfaces="road", sigma=sigma, cell_m=0.02))
    bare, shot = shoot(sensor(), ROAD)
    known = expect(model.effects, shot)
    beam, true = bare.beam, bare.intensity * np.exp(sigma**2 / 2)
    assert not known.intensity_sigma.any()
    other = expect(model.effects, shot.with_texture(1)).intensity[beam]
    assert other.mean() == pytest.approx(true.mean(), rel=0.05)
    assert abs(np.corrcoef(other / bare.intensity, known.intensity[beam] / bare.intensity)[0, 1]) < 0.3
    shot.is_texture_known = False
    unknown = expect(model.effects, shot)
    assert unknown.intensity[beam].mean() == pytest.approx(true.mean(), rel=0.05)
    spread = np.sqrt(np.mean((unknown.intensity_sigma[beam] / true) ** 2))
    assert spread == pytest.approx(np.sqrt(np.exp(sigma**2) - 1), rel=0.15)
    np.testing.assert_array_equal(unknown.seen, known.seen)
    np.testing.assert_allclose(unknown.range_m[beam], known.range_m[beam], rtol=1e-6)
