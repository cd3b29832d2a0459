"""Footprints at some radii give those at others, and those of slightly deflected beams."""

from dataclasses import fields, replace

import numpy as np
import pytest

from sensors.effects.surfaces.footprint import directions_aside
from sensors.effects.surfaces.footprint_cache import FootprintCache
from sensors.rays import Rays
from sensors.shot import Shot
from tests.sensors.effects.scenes import cars, sensor, shoot, street

LOWER_RAD, RADIUS_RAD, UPPER_RAD = 1.4e-3, 1.5e-3, 1.6e-3


@pytest.fixture(scope="module")
def whole():
    return shoot(sensor(), street(), placed=cars(velocity=(5.0, 0.0, 0.0)))[1]


def some_of(whole, step=37):
    rows = np.arange(0, len(whole.rays), step)
    rays = Rays(*(getattr(whole.rays, field.name)[rows] for field in fields(Rays)))
    return Shot(whole.pattern, rays, world=whole.world, whole=whole, rows=rows), np.arange(len(rows))


def differing(one, other, atol_m=2e-3):
    """Share of surfaces that are not the same."""
    same = (one.instance == other.instance) & (one.material == other.material)
    return 1 - np.mean(same & np.isclose(one.range_m, other.range_m, rtol=1e-4, atol=atol_m))


def test_what_lies_between_two_radii_is_what_rays_would_meet(whole):
    shot, beam = some_of(whole)
    known, fresh = FootprintCache(shot, beam), FootprintCache(shot, beam)
    lower, upper = known.met(LOWER_RAD), known.met(UPPER_RAD)
    traced = fresh.met(RADIUS_RAD)
    assert differing(lower, upper) > 0.02, "footprints of other radii meet something else"
    assert differing(known.met(RADIUS_RAD), traced) < 1e-3


def test_a_radius_requested_again_gives_the_same_result(whole):
    shot, beam = some_of(whole, 301)
    known = FootprintCache(shot, beam)
    first = known.met(RADIUS_RAD)
    for number in range(20):
        known.met(2e-3 + 1e-4 * number)
    assert differing(known.met(RADIUS_RAD), first) < 1e-3


def test_beams_that_stand_a_little_aside_meet_the_same_faces(whole):
    shot, beam = some_of(whole)
    traced = whole.traced
    origin, direction = traced.origin[shot.rows], traced.direction[shot.rows]
    time_s = np.broadcast_to(traced.time_s, len(whole.rays))[shot.rows]
    known = FootprintCache(shot, beam)
    assert known.bent(RADIUS_RAD, origin, direction, time_s) is known.met(RADIUS_RAD)
    higher = (traced.origin - traced.hits.pose[:3, 3] + np.array([0.0, 0.0, 0.02])).astype(np.float32)
    later = np.full(len(whole.rays), traced.delay_s, np.float32)
    moved = replace(traced, moving=(higher, traced.direction, later))
    aside = Shot(whole.pattern, whole.rays, traced=moved, world=whole.world)
    requested = Shot(shot.pattern, shot.rays, world=whole.world, whole=aside, rows=shot.rows)
    bent = known.bent(RADIUS_RAD, moved.origin[shot.rows], direction, time_s)
    assert differing(bent, FootprintCache(requested, beam).met(RADIUS_RAD), atol_m=0.03) < 0.03


def test_surfaces_of_objects_move_with_them_if_beams_leave_later(whole):
    shot, beam = some_of(whole)
    traced = whole.traced
    origin, direction = traced.origin[shot.rows], traced.direction[shot.rows]
    time_s = np.broadcast_to(traced.time_s, len(whole.rays))[shot.rows] + np.float32(0.1)
    known = FootprintCache(shot, beam)
    met, later = known.met(RADIUS_RAD), known.bent(RADIUS_RAD, origin, direction, time_s)
    on_cars = met.instance >= 0
    assert on_cars.any() and not np.allclose(later.range_m[on_cars], met.range_m[on_cars], atol=0.1)
    np.testing.assert_allclose(later.range_m[~on_cars], met.range_m[~on_cars], rtol=1e-4)
    anew = whole.world.shoot(
        np.repeat(origin, 4, axis=0), directions_aside(direction, RADIUS_RAD).reshape(-1, 3), np.repeat(time_s, 4),
        whole.pattern.range_m[1],
    )  # fmt: skip
    same = on_cars & (anew.normal_code == met.normal_code).all(1) & (anew.instance == met.instance)
    assert same.sum() > 0.5 * on_cars.sum()
    np.testing.assert_allclose(later.range_m[same], anew.range_m[same], atol=0.03)


def test_beams_that_leave_hardly_later_meet_the_same_surfaces(whole):
    """Also where they are assumed to meet the surface of another beam."""
    shot, beam = some_of(whole)
    traced = whole.traced
    origin, direction = traced.origin[shot.rows], np.roll(traced.direction, 3, axis=0)[shot.rows]
    time_s = np.broadcast_to(traced.time_s, len(whole.rays))[shot.rows]
    known = FootprintCache(shot, beam)
    now, later = (known.bent(RADIUS_RAD, origin, direction, time_s + dt) for dt in (np.float32(0), np.float32(1e-7)))
    np.testing.assert_allclose(later.range_m, now.range_m, atol=1e-3)


def test_single_rays_meet_what_the_revolution_met(whole):
    traced, rows = whole.traced, np.arange(0, len(whole.rays), 11)
    time_s = np.broadcast_to(traced.time_s, len(whole.rays))[rows]
    met = whole.world.shoot(traced.origin[rows], traced.direction[rows], time_s, whole.pattern.range_m[1])
    assert (met.instance >= 0).sum() > 50
    assert differing(met, traced.hits.solid.take(rows)) < 1e-3
