"""Parts of the own vehicle hide surfaces behind them, and no others."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ndtr

from sensors.scene import Scene
from tests.sensors.effects.scenes import effect, no_model, of_hits, sensor
from tests.sensors.worlds import plane

ROAD = Scene(plane(), no_model)


@settings(max_examples=10, deadline=None)
@given(azimuth=st.floats(-180, 180), width=st.floats(1, 350), top=st.floats(-24, -3))
def test_beams_of_the_sector_below_the_top_are_lost_and_no_others(azimuth, width, top):
    bare, shot = of_hits(sensor(), ROAD)
    found, _ = of_hits(sensor(effect("own_shadow", azimuth_deg=azimuth, width_deg=width, top_deg=top)), ROAD)
    turned = (np.degrees(shot.rays.azimuth) - azimuth + 180) % 360 - 180
    elevation = np.degrees(np.arcsin(shot.rays.direction[:, 2]))
    clear = (np.abs(np.abs(turned) - width / 2) > 1e-3) & (np.abs(elevation - top) > 1e-3)
    hidden = (np.abs(turned) < width / 2) & (elevation < top)
    lost = np.setdiff1d(bare.beam, found.beam)
    np.testing.assert_array_equal(np.isin(bare.beam, lost)[clear[bare.beam]], hidden[bare.beam][clear[bare.beam]])


def test_the_ends_of_a_silhouette_move_from_scan_to_scan():
    """A beam outside the mean end is hidden as often as the drawn end lies beyond it, in draws and in expectation."""
    sigma, scans = 0.5, 400
    silhouette = effect("own_silhouette", rings=(60,), from_deg=(-20.0,), to_deg=(20.0,), sigma_deg=sigma)
    bare, shot = of_hits(sensor(), ROAD)
    kept = np.zeros(len(bare))
    for seed in range(scans):
        kept[np.isin(bare.beam, silhouette.apply(bare, shot, np.random.default_rng(seed)).beam)] += 1 / scans
    turn, ring = np.degrees(shot.rays.azimuth[bare.beam]), shot.rays.ring[bare.beam]
    inside = np.where(ring == 60, ndtr((turn + 20) / sigma) * ndtr((20 - turn) / sigma), 0)
    np.testing.assert_allclose(kept, 1 - inside, atol=0.1)
    np.testing.assert_allclose(silhouette.expected(bare, shot)[1], 1 - inside, atol=1e-6)


def test_the_kitti_sensor_hides_what_its_car_hides_in_every_scan():
    from sensors.sensor_model import SensorModel, load_sensor

    kitti = load_sensor("kitti")
    parts = tuple(entry for entry in kitti.effects if entry.name == "own_silhouette")
    found, shot = of_hits(SensorModel(kitti.pattern, parts), ROAD)
    seen = np.zeros(len(shot.rays), bool)
    seen[found.beam] = True
    behind, aside = np.abs(shot.rays.azimuth) > 3.0, np.abs(np.abs(shot.rays.azimuth) - 1.9) < 0.1
    lowest = shot.rays.ring >= 60
    assert not seen[lowest & behind].any()
    assert seen[lowest & aside].all()
