"""Rails lie at the gauge of 1.435 m on lanes with tracks."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from assets.materials import material_index
from assets.streets import Streets
from assets.world.roads.tracks import GAUGE_M, RAIL_M, tracks_mesh

from .small_town import small_town


def flat(xy: np.ndarray) -> np.ndarray:
    return np.zeros(len(xy))


def tracked(*uses: str) -> Streets:
    """The small town with tracks in the lane `0in_1`, whose use may be another one."""
    streets = small_town()
    lanes = tuple(
        replace(lane, tracks=True, **({"use": uses[0]} if uses else {})) if lane.id == "0in_1" else lane
        for lane in streets.lanes
    )
    return replace(streets, lanes=lanes)


def part(mesh, material: str) -> np.ndarray:
    return mesh.select(mesh.materials == material_index(material)).triangles


def test_streets_without_tracks_have_no_rails():
    assert not len(tracks_mesh(small_town(), flat).faces)


@pytest.mark.parametrize("uses", [(), ("tram",)])
def test_two_rails_lie_on_the_lane_at_the_gauge(uses):
    streets = tracked(*uses)
    line = shapely.LineString(next(lane.centre[:, :2] for lane in streets.lanes if lane.tracks))
    rails = part(tracks_mesh(streets, flat), "rail")
    aside = shapely.distance(line, shapely.points(rails.reshape(-1, 3)[:, :2].astype(float)))
    assert aside.min() == pytest.approx(GAUGE_M / 2, abs=1e-3)
    assert aside.max() == pytest.approx(GAUGE_M / 2 + RAIL_M, abs=1e-3)
    area = 0.5 * np.linalg.norm(np.cross(rails[:, 1] - rails[:, 0], rails[:, 2] - rails[:, 0]), axis=1).sum()
    assert area == pytest.approx(2 * line.length * RAIL_M, rel=1e-3)
    assert (rails[..., 2] > 0).all() and (rails[..., 2] < 0.01).all()


def test_only_tracks_of_their_own_have_a_bed_of_gravel():
    assert not len(part(tracks_mesh(tracked(), flat), "gravel"))
    streets = tracked("tram")
    bed = part(tracks_mesh(streets, flat), "gravel")
    assert len(bed)
    roads = [lane.centre[:, :2] for lane in streets.lanes if lane.use == "drive"]
    middles = shapely.points(bed.mean(1)[:, :2].astype(float))
    assert min(shapely.distance(shapely.LineString(road), middles).min() for road in roads) > 1.5
