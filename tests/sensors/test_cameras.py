"""Camera images hold the geometry to the pixel and the millimetre."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from assets import build_model
from assets.mesh import Mesh
from sensors.cameras import CameraError, CameraRenderer, Light, SunShadows
from sensors.cameras.baking import bake_hollows
from sensors.cameras.detail import CELLS_M, coarsened, level_of

WIDTH, HEIGHT, FOCAL = 320, 240, 300.0
P = np.array([[FOCAL, 0, 150.3, 0], [0, FOCAL, 118.7, 0], [0, 0, 1, 0]])
# camera at the world's origin looking along +x, 1.5 m above the ground
POSE = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.5], [0, 0, 0, 1.0]])
CLEAR = Light(haze_per_m=0.0)


def _osmesa_missing() -> bool:
    for name in ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"):
        try:
            ctypes.CDLL(name)
        except OSError:
            continue
        return False
    return True


needs_osmesa = pytest.mark.skipif(_osmesa_missing(), reason="libosmesa6 is not installed")


def cuboid(size, centre=(0.0, 0.0, 0.0), material="plaster_white") -> Mesh:
    """A box with outward faces."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]
    return Mesh.of(signs * size + centre, faces, material)


def ground(side=400.0, cells=80, z=0.0, material="asphalt") -> Mesh:
    """A flat, tessellated square round the origin, facing up."""
    line = np.linspace(-side / 2, side / 2, cells + 1)
    x, y = np.meshgrid(line, line, indexing="ij")
    i = np.arange((cells + 1) ** 2).reshape(cells + 1, -1)
    a, b, c, d = (k.ravel() for k in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return Mesh.of(np.stack([x.ravel(), y.ravel(), np.full(x.size, z)], 1), faces, material)


def placed(*rows, rgb=(0.5, 0.1, 0.1)) -> SimpleNamespace:
    """Instances from (model, position, scale) rows."""
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    for pose, (_, position, _) in zip(poses, rows, strict=True):
        pose[:3, 3] = position
    return SimpleNamespace(
        ids=tuple(str(k) for k in range(len(rows))),
        models=tuple(model for model, _, _ in rows),
        poses=poses,
        scales=np.array([scale for _, _, scale in rows], np.float64).reshape(-1, 3),
        rgb=np.tile(np.float32(rgb), (len(rows), 1)),
    )


NOBODY = placed()
MODELS = {
    "crate": cuboid((1.0, 1.0, 1.0), material="car_paint"),
    "post": cuboid((0.2, 0.2, 2.0)),
    "pane": cuboid((0.02, 1.0, 1.0), material="car_glass"),
}


def shoot(static: Mesh, instances=NOBODY, light=CLEAR, pose=POSE, projection=P, shade=None):
    """One image of a small world."""
    with CameraRenderer(static, MODELS, light, width=WIDTH, height=HEIGHT, shade=shade) as renderer:
        return renderer.render(pose, projection, instances)


def pixel_rays() -> np.ndarray:
    """Camera-axes directions of unit depth through the pixel centres, (h, w, 3)."""
    v, u = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
    return np.stack([(u - P[0, 2]) / FOCAL, (v - P[1, 2]) / FOCAL, np.ones_like(u)], -1)


@needs_osmesa
@pytest.mark.parametrize("distance", [0.5, 5.0, 50.0, 200.0])
def test_a_wall_stands_at_its_distance(distance):
    images = shoot(cuboid((1.0, 3000.0, 3000.0), (distance + 0.5, 0, 0)))
    assert np.abs(images.depth_m - distance).max() < max(1e-3, 2e-5 * distance)


@needs_osmesa
def test_the_ground_lies_where_each_pixels_ray_meets_it():
    images = shoot(ground())
    rays = pixel_rays()
    with np.errstate(divide="ignore"):
        expected = np.where(rays[..., 1] > 0, 1.5 / rays[..., 1], np.inf)
    near = expected < 50.0
    assert near.sum() > 20_000
    assert np.abs(images.depth_m - expected)[near].max() < 0.005


@needs_osmesa
def test_depth_survives_a_world_a_kilometre_from_the_origin():
    far = np.array([900.0, -700.0, 30.0])
    pose = POSE.copy()
    pose[:3, 3] += far
    images = shoot(cuboid((1.0, 100.0, 100.0), far + np.array([20.5, 0, 0])), pose=pose)
    assert np.abs(images.depth_m - 20.0).max() < 0.002


@needs_osmesa
@pytest.mark.parametrize("pixel", [(100, 50), (0, 0), (WIDTH - 1, HEIGHT - 1), (151, 119)])
def test_a_speck_projected_to_a_pixel_lights_that_pixel_only(pixel):
    depth, u, v = 10.0, *pixel
    x, y = (u - P[0, 2]) / FOCAL * depth, (v - P[1, 2]) / FOCAL * depth
    side = 0.6 * depth / FOCAL
    images = shoot(cuboid((1e-3, side, side), (depth, -x, 1.5 - y)))
    assert np.argwhere(images.depth_m > 0).tolist() == [[v, u]]


@needs_osmesa
def test_the_fourth_column_of_p_moves_the_camera():
    stereo = P.copy()
    stereo[0, 3] = -FOCAL * 0.54
    images = shoot(Mesh.empty(), placed(("crate", (10.0, 0, 1.5), (1, 1, 1))), projection=stereo)
    columns = np.flatnonzero((images.instance == 1).any(0))
    expected = P[0, 2] - FOCAL * 0.54 / 9.5
    assert columns.mean() == pytest.approx(expected, abs=0.5)


@needs_osmesa
def test_an_instances_pixels_fill_its_projected_rectangle():
    images = shoot(ground(), placed(("crate", (10.5, 0.3, 1.6), (1.0, 2.0, 0.5))))
    mask = images.instance == 1
    wide, high = FOCAL * 2.0 / 10.0, FOCAL * 0.5 / 10.0
    assert abs(mask.any(0).sum() - wide) <= 1 and abs(mask.any(1).sum() - high) <= 1
    v, u = np.argwhere(mask).mean(0)
    assert u == pytest.approx(P[0, 2] - FOCAL * 0.03, abs=0.5)
    assert v == pytest.approx(P[1, 2] - FOCAL * 0.01, abs=0.5)
    assert np.allclose(images.depth_m[mask], 10.0, atol=1e-3)


@needs_osmesa
def test_numbers_follow_the_order_given_and_exceed_a_byte():
    # three rows of a hundred specks, each about three pixels wide
    places = [(10.0, -5.0 + 0.1 * (k % 100), 1.0 + 0.5 * (k // 100)) for k in range(300)]
    rows = [("crate", at, (0.08,) * 3) if k % 3 else ("post", at, (0.4, 0.4, 0.04)) for k, at in enumerate(places)]
    images = shoot(Mesh.empty(), placed(*rows))
    for k in (0, 50, 99, 150, 199, 255, 256, 290):
        _, y, z = places[k]
        u, v = P[0, 2] - FOCAL * y / 9.96, P[1, 2] - FOCAL * (z - 1.5) / 9.96
        assert images.instance[round(v), round(u)] == k + 1


@needs_osmesa
def test_a_post_in_front_takes_pixels_from_the_crate_behind():
    crate = ("crate", (10.0, 0.0, 1.5), (1, 1, 1))
    free = (shoot(Mesh.empty(), placed(crate)).instance == 1).sum()
    both = shoot(Mesh.empty(), placed(crate, ("post", (5.0, 0.0, 1.5), (1, 1, 1)))).instance
    assert 0.4 * free < (both == 1).sum() < 0.75 * free
    hidden = shoot(cuboid((0.5, 4.0, 4.0), (5.0, 0.0, 1.5)), placed(crate)).instance
    assert (hidden == 1).sum() == 0


@needs_osmesa
def test_glass_hides_nothing():
    crate = ("crate", (10.0, 0.0, 1.5), (1, 1, 1))
    alone = shoot(ground(), placed(crate))
    behind = shoot(
        Mesh.merge([ground(), cuboid((0.02, 9, 9), (4, 0, 1.5), "window_glass")]),
        placed(crate, ("pane", (6.0, 0.0, 1.5), (1, 1, 1))),
    )
    assert np.array_equal(alone.depth_m, behind.depth_m)
    assert np.array_equal(alone.instance, behind.instance)


@needs_osmesa
def test_both_sides_of_a_sheet_stop_light():
    sheet = Mesh.of([[5, -3, -3], [5, 3, -3], [5, 0, 6]], [[0, 1, 2]], "tarpaulin")
    turned = Mesh(sheet.vertices, sheet.faces[:, ::-1], sheet.materials)
    seen, seen_turned = shoot(sheet), shoot(turned)
    assert (seen.depth_m > 0).sum() > 1000
    assert np.array_equal(seen.depth_m, seen_turned.depth_m)


@needs_osmesa
def test_the_sky_has_no_depth_and_no_instance():
    images = shoot(ground())
    sky = pixel_rays()[..., 1] < -0.01
    assert not images.depth_m[sky].any() and not images.instance.any()
    blue, red = images.rgb[sky][:, 2].astype(int), images.rgb[sky][:, 0].astype(int)
    assert (blue >= red).all() and images.gray[sky].min() > 60


@needs_osmesa
def test_a_face_turned_to_the_sun_is_brighter():
    crate = placed(("crate", (6.0, 0.0, 1.5), (1, 1, 1)))
    facing = shoot(Mesh.empty(), crate, Light(sun_azimuth_deg=180.0, sun_elevation_deg=20.0))
    away = shoot(Mesh.empty(), crate, Light(sun_azimuth_deg=0.0, sun_elevation_deg=20.0))
    mask = facing.instance == 1
    assert facing.gray[mask].mean() > 1.3 * away.gray[mask].mean()


@needs_osmesa
def test_paint_colours_the_instance_and_nothing_else():
    crate = ("crate", (6.0, 0.0, 1.5), (1, 1, 1))
    post = ("post", (6.0, 1.5, 1.5), (1, 1, 1))
    red = shoot(Mesh.empty(), placed(crate, post, rgb=(0.6, 0.0, 0.0)))
    blue = shoot(Mesh.empty(), placed(crate, post, rgb=(0.0, 0.0, 0.6)))
    assert (red.rgb[red.instance == 1][:, 0] > 2 * red.rgb[red.instance == 1][:, 2].astype(int)).all()
    assert np.array_equal(red.rgb[red.instance == 2], blue.rgb[blue.instance == 2])


@needs_osmesa
def test_a_roof_shades_the_ground_below_it():
    world = Mesh.merge([ground(40.0, 80), cuboid((6.0, 6.0, 0.3), (10.0, 0.0, 4.0))])
    noon = Light(sun_elevation_deg=90.0, haze_per_m=0.0)
    shade = SunShadows(world, noon)
    lit, shaded = shoot(world, light=noon), shoot(world, light=noon, shade=shade)
    below = tuple(np.round([P[1, 2] + FOCAL * 0.15, P[0, 2]]).astype(int))
    assert shaded.gray[below] < 0.8 * lit.gray[below]
    assert shaded.gray[-1, 0] == pytest.approx(lit.gray[-1, 0], abs=6)


@needs_osmesa
def test_what_is_left_out_would_not_have_shown(monkeypatch):
    rng = np.random.default_rng(3)
    blocks = [cuboid(rng.uniform(2, 12, 3), (x, y, 2.0)) for x, y in rng.uniform((20, -60), (200, 60), (60, 2))]
    world = Mesh.merge([ground(), cuboid((1.0, 6.0, 5.0), (15.0, 4.0, 2.0)), *blocks])
    places = rng.uniform((6, -30, 0.5), (120, 30, 2.5), (80, 3))
    crowd = placed(*(("crate", at, rng.uniform(0.5, 3.0, 3)) for at in places))
    quick = shoot(world, crowd)
    monkeypatch.setattr("sensors.cameras.occlusion.Horizon.hides", lambda _, corners: np.zeros(len(corners), bool))
    for module in ("tiles", "packed_model"):
        monkeypatch.setattr(f"sensors.cameras.{module}.closed_faces", lambda mesh: np.zeros(len(mesh.faces), bool))
    full = shoot(world, crowd)
    assert len(np.unique(full.instance)) > 10
    for name in ("depth_m", "instance", "rgb"):
        assert np.array_equal(getattr(quick, name), getattr(full, name))


def test_undersides_and_hollows_of_a_model_darken():
    table = Mesh.merge([cuboid((2, 1, 0.1), (0, 0, 0.7)), cuboid((0.1, 0.1, 0.65), (0, 0, 0.325))])
    light = bake_hollows(table)[:, 1]
    top, underside = np.isclose(table.vertices[:, 2], 0.75), np.isclose(table.vertices[:, 2], 0.65)
    assert light[top].min() > light[underside].max()


def _resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


@needs_osmesa
def test_25_renders_compile_nothing_new_and_repeat_to_the_bit():
    with CameraRenderer(ground(), MODELS, Light(), width=WIDTH, height=HEIGHT) as renderer:
        crate = placed(("crate", (6.0, 0.0, 1.5), (1, 1, 1)))
        first = renderer.render(POSE, P, crate)
        programs, memory = len(renderer._painter._context.programs), _resident_bytes()
        last = [renderer.render(POSE, P, crate) for _ in range(25)][-1]
        assert len(renderer._painter._context.programs) == programs <= 3
        assert _resident_bytes() - memory < 30e6
    for name in ("rgb", "gray", "depth_m", "instance"):
        assert np.array_equal(getattr(first, name), getattr(last, name))


@needs_osmesa
def test_renderers_of_two_sizes_do_not_disturb_each_other():
    crate = placed(("crate", (6.0, 0.0, 1.5), (1, 1, 1)))
    with (
        CameraRenderer(ground(), MODELS, CLEAR, width=WIDTH, height=HEIGHT) as large,
        CameraRenderer(ground(), MODELS, CLEAR, width=WIDTH // 2, height=HEIGHT) as small,
    ):
        first = large.render(POSE, P, crate)
        part = small.render(POSE, P, crate)
        again = large.render(POSE, P, crate)
    assert np.array_equal(first.depth_m, again.depth_m) and np.array_equal(first.rgb, again.rgb)
    assert np.allclose(part.depth_m, first.depth_m[:, : WIDTH // 2], atol=1e-3)


@needs_osmesa
def test_a_closed_renderer_says_so():
    renderer = CameraRenderer(ground(), MODELS, Light(), width=WIDTH, height=HEIGHT)
    renderer.close()
    with pytest.raises(CameraError, match="closed"):
        renderer.render(POSE, P, NOBODY)


def _python(code: str) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)


def test_importing_the_package_loads_no_opengl():
    done = _python(
        "import sys, sensors.cameras; sys.exit(any(m in sys.modules for m in ('pyrender', 'OpenGL', 'torch')))"
    )
    assert done.returncode == 0, done.stderr


def test_a_missing_library_is_named_with_its_remedy():
    done = _python(
        "import ctypes\n"
        "from assets.mesh import Mesh\n"
        "from sensors.cameras import CameraError, CameraRenderer, Light\n"
        "def missing(name, *args, **kwargs): raise OSError(name)\n"
        "ctypes.CDLL = missing\n"
        "try: CameraRenderer(Mesh.empty(), {}, Light(), width=8, height=8)\n"
        "except CameraError as error: print(error)\n"
    )
    assert "apt-get install libosmesa6" in done.stdout and done.stdout.count("\n") == 1, done.stderr


@pytest.mark.parametrize("name", ["hatchback_01", "truck_01", "bicycle_01"])
@pytest.mark.parametrize("cell_m", CELLS_M[1:])
def test_a_coarser_model_keeps_its_outline_to_a_cell(name, cell_m):
    mesh = build_model(name)
    coarse = coarsened(mesh, cell_m)
    assert len(coarse.faces) < len(mesh.faces) * (0.6 if cell_m < 0.2 else 0.35)
    np.testing.assert_allclose(coarse.bounds, mesh.bounds, atol=cell_m)
    assert (coarse.normals**2).sum(1) == pytest.approx(1, abs=1e-3)


def test_detail_falls_where_cells_shrink_below_pixels():
    levels = level_of(np.array([5.0, 30.0, 60.0, 85.0, 100.0, 390.0]), focal_px=721.5)
    assert levels.tolist() == [0, 0, 1, 1, 2, 2]


@needs_osmesa
def test_what_was_seen_before_changes_no_image():
    rng = np.random.default_rng(5)
    blocks = [cuboid(rng.uniform(2, 9, 3), (x, y, 2.0)) for x, y in rng.uniform((10, -60), (150, 60), (50, 2))]
    plain = ground(200.0, 80)
    rise = np.column_stack([np.zeros((len(plain.vertices), 2)), rng.normal(0, 0.2, len(plain.vertices))])
    world = Mesh.merge([Mesh(plain.vertices + rise, plain.faces, plain.materials), *blocks])
    shade, turned = SunShadows(world, Light()), POSE.copy()
    turned[:3, :3] = POSE[:3, :3] @ np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
    with CameraRenderer(world, MODELS, Light(), width=WIDTH, height=HEIGHT, shade=shade) as fresh:
        first = fresh.render(POSE, P, NOBODY)
    with CameraRenderer(world, MODELS, Light(), width=WIDTH, height=HEIGHT, shade=shade) as used:
        used.render(turned, P, NOBODY)
        later = used.render(POSE, P, NOBODY)
    assert np.array_equal(first.depth_m, later.depth_m)
    assert np.array_equal(first.rgb, later.rgb)
