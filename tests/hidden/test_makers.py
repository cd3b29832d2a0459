"""Hidden effects are in the data where they should be, and nowhere else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.hidden.amplitudes import STRENGTHS, parameters
from tests.hidden.clutter import blooming
from tests.hidden.drive import Hidden, make_drive, reduced
from tests.hidden.floor import noise_floor
from tests.hidden.glb_edit import read_triangles
from tests.hidden.head import nominal_beams
from tests.hidden.nuisances import NUISANCES, written_frames
from tests.hidden.physics import BIAS, CATALOGUE, RAYS, Truth, measure
from tests.hidden.reading import LAWS
from tests.hidden.scan import Scan
from tests.hidden.tall_things import move_tall_things
from tests.hidden.twin_files import read_frames, read_pattern
from tests.hidden.twin_tracing import Twin

_SMALL = Hidden(firings=400, every_ring=2, noise=False)

# Columns that an effect changes among the beams that return, and those that it does not change.
_CHANGES = {
    "beam_divergence": "range intensity found",
    "wet_road": "found intensity range",
    "glass_transmission": "intensity range found",
    "mirror_ghost": "range intensity found",
    "atmospheric_extinction": "intensity found",
    **dict.fromkeys(("incidence_falloff", "range_falloff", "focal_response", "ring_gain"), "intensity"),
    **dict.fromkeys(("retroreflection", "intensity_noise", "intensity_quantization"), "intensity"),
    **dict.fromkeys(("detection_threshold", "random_dropout", "max_range"), "found"),
    **dict.fromkeys((*BIAS, "range_noise", "range_quantization"), "range"),
    **dict.fromkeys(("backscatter", "false_alarms"), "range intensity found"),
    "blooming": "range intensity",
    **dict.fromkeys(RAYS, "range intensity found"),
}


class Bench:
    """One frame of the twin, measured with a thin pattern."""

    def __init__(self, base: Path) -> None:
        self.twin, self.frame = Twin(base / "twin"), read_frames(base)[-1]
        self.beams = nominal_beams(reduced(read_pattern(base), _SMALL))
        self.bare = self.scan()

    def scan(self, seed: int = 1, **truth) -> Scan:
        return measure(Truth(**truth), self.twin, self.frame, self.beams, np.random.default_rng(seed), elapsed_s=6.0)

    def strong(self, name: str) -> dict:
        return parameters(name, "strong", np.random.default_rng(3), self.beams.rings)


@pytest.fixture(scope="module")
def bench(base: Path) -> Bench:
    return Bench(base)


def test_an_undisturbed_drive_is_the_bare_sensors(base: Path, tmp_path: Path) -> None:
    made = make_drive(base, tmp_path / "drive", Hidden(noise=False, frames=1))
    same = total = 0
    for path in sorted((made.drive / "velodyne").glob("*.bin")):
        ours, theirs = _by_beam(made.drive, path.stem), _by_beam(base, path.stem)
        assert abs(len(ours) - len(theirs)) < 0.001 * len(theirs)
        common = ours.keys() & theirs.keys()
        gap = np.array([ours[beam] for beam in common]) - np.array([theirs[beam] for beam in common])
        same += (np.abs(gap).max(1) < 1e-3).sum()
        total += len(ours.keys() | theirs.keys())
    assert same > 0.995 * total


def test_every_effect_has_a_strength() -> None:
    assert set(STRENGTHS) == set(CATALOGUE) == set(_CHANGES)


@pytest.mark.parametrize("name", CATALOGUE)
def test_effect_is_seen_in_its_columns_only(bench: Bench, name: str) -> None:
    if name == "blooming":
        pytest.skip("needs a retro-reflector in sight; see its own test")
    scan, bare = bench.scan(effects={name: bench.strong(name)}), bench.bare
    both = scan.found & bare.found
    changed = {
        "found": bool((scan.found != bare.found).any()),
        "range": bool((np.abs(scan.range_m - bare.range_m)[both] > 1e-3).any()),
        "intensity": bool((np.abs(scan.intensity - bare.intensity)[both] > 1e-3).any()),
    }
    allowed = set(_CHANGES[name].split())
    assert {column for column, is_so in changed.items() if is_so} <= allowed
    assert any(changed[column] for column in allowed)


def test_only_glass_and_metal_make_ghosts(bench: Bench) -> None:
    scan, bare = bench.scan(effects={"mirror_ghost": {"strength": 1.0}}), bench.bare
    moved = np.abs(scan.range_m - bare.range_m) > 1e-3
    mirrors = bare.before_solid() | (bench.twin.table.metal[bare.solid.material] & bare.found)
    assert moved.any()
    assert not moved[~mirrors].any()


def test_only_road_is_wet(bench: Bench) -> None:
    scan, bare = bench.scan(effects={"wet_road": {"film": 1.0}}), bench.bare
    road = bare.found & bench.twin.table.road[bare.solid.material]
    np.testing.assert_array_equal(scan.found[~road], bare.found[~road])
    assert (~scan.found[road]).any()
    dry_return = scan.found & road & (scan.range_m == bare.range_m)
    np.testing.assert_allclose(scan.intensity[dry_return], bare.intensity[dry_return] / 2)
    below = scan.found & road & ~dry_return
    assert (scan.range_m[below] > bare.range_m[below]).all()


def test_rays_from_inside_an_object_hit_it(bench: Bench) -> None:
    """As beams do that a wet road mirrors from beneath a car."""
    cars = 0
    for row, thing in enumerate(bench.frame["instances"]):
        pose, model = np.array(thing["pose"], float), bench.twin._model(thing["model"])
        if not 2 < model.radius < 3.2:
            continue  # no car: the body must be closed
        cars += 1
        ahead = pose[:3, 0] * np.array([[1.0], [-1.0]])
        middle = pose[:3, :3] @ (model.centre * thing["scale"]) + pose[:3, 3]
        below = -0.1 * model.radius * pose[:3, 2]  # the bonnet
        near_the_end = middle + below + 0.73 * model.radius * thing["scale"][0] * ahead  # the middle lies behind
        found = bench.twin.cast(bench.frame, near_the_end, ahead, 0.0, (0.0, 50.0))
        own = np.logical_or.reduce([(one.instance == row) & (one.distance < 1.5) for one in found])
        assert own.all(), thing["model"]
    assert cars > 3


def test_blooming_answers_at_the_range_of_the_reflector(bench: Bench) -> None:
    retro = int(np.flatnonzero(bench.twin.table.retro)[0])
    scan = bench.scan()
    source = int(np.flatnonzero(scan.found & (scan.range_m < 20))[0])
    scan.material[source], scan.intensity[source], scan.range_m[source] = retro, 0.9, 3.0
    others = np.setdiff1d(np.flatnonzero(scan.found & (bench.twin.table.retro[scan.material])), [source])
    scan.intensity[others] = 0.0
    before = scan.range_m.copy()
    blooming(scan, None, radius_deg=2.0, threshold=0.7)
    moved = np.flatnonzero(scan.range_m != before)
    angle = np.arccos(np.clip(bench.beams.direction[moved] @ bench.beams.direction[source], -1, 1))
    assert len(moved)
    assert (np.degrees(angle) <= 2.0 + 1e-3).all()
    np.testing.assert_allclose(scan.range_m[moved], 3.0)  # metres
    np.testing.assert_allclose(scan.intensity[moved], 0.27)


def test_a_beam_turned_up_meets_the_ground_farther_off(bench: Bench) -> None:
    scan, bare = bench.scan(effects={"elevation_offset": {"offset_deg": 0.1}}), bench.bare
    ground = scan.found & bare.found & (scan.instance == -1) & (bare.solid.normal[:, 2] > 0.99)
    ground &= (bare.material == scan.material) & (bare.range_m < 20)
    assert np.median((scan.range_m - bare.range_m)[ground]) > 0


def test_a_sensor_moved_forward_is_nearer_to_what_is_ahead(bench: Bench) -> None:
    scan, bare = bench.scan(effects={"mount_translation": {"x_m": 0.1}}), bench.bare
    forward = np.array(bench.frame["ego"]["pose"])[:3, 0]
    faces = scan.found & bare.found & (np.abs(bare.solid.normal @ forward) > 0.9)
    ahead, behind = (faces & (sign * np.cos(bench.beams.azimuth) > 0.5) for sign in (1, -1))
    assert np.median((scan.range_m - bare.range_m)[ahead]) < -0.05
    assert np.median((scan.range_m - bare.range_m)[behind]) > 0.05


def test_order_in_a_truth_does_not_matter(bench: Bench) -> None:
    names = ("range_walk", "incidence_falloff", "elevation_offset", "range_noise", "random_dropout")
    effects = {name: bench.strong(name) for name in names}
    one, other = bench.scan(effects=effects), bench.scan(effects=dict(reversed(effects.items())))
    np.testing.assert_array_equal(one.range_m, other.range_m)
    np.testing.assert_array_equal(one.found, other.found)


@pytest.mark.parametrize("law", LAWS)
def test_noise_distributions_have_unit_variance(law: str) -> None:
    sample = LAWS[law](np.random.default_rng(0), 1_000_000)
    assert np.std(sample) == pytest.approx(1, rel=0.05)
    assert np.mean(sample) == pytest.approx(0, abs=0.01)


def test_a_made_drive_does_not_reveal_the_truth(base: Path, tmp_path: Path) -> None:
    hidden = replace(_SMALL, noise=True, effects={"range_walk": {"amplitude_m": 0.05, "decay": 4.0}}, frames=1)
    made = make_drive(base, tmp_path / "drive", hidden)
    files = {path.name for path in made.drive.rglob("*")}
    assert not files & {"sensor.yaml", "hits", made.truth.name}
    assert made.drive not in made.truth.parents
    assert yaml.safe_load((made.drive / "drive.yaml").read_text())["kind"] == "measured"
    believed = {entry["effect"] for entry in yaml.safe_load(made.sensor.read_text())["effects"]}
    assert believed == {"range_noise", "intensity_noise"}
    assert all(b"range_walk" not in path.read_bytes() for path in made.drive.rglob("*") if path.is_file())


def test_nuisances_are_in_the_twin_and_not_in_the_scan(base: Path, tmp_path: Path) -> None:
    tiny = replace(_SMALL, firings=60, every_ring=8, frames=2)
    plain = make_drive(base, tmp_path / "plain", tiny)
    odd = make_drive(base, tmp_path / "odd", replace(tiny, nuisances=NUISANCES))
    scans = sorted(path.relative_to(plain.drive) for path in plain.drive.glob("velodyne/*"))
    assert all((plain.drive / path).read_bytes() == (odd.drive / path).read_bytes() for path in scans)
    world = "twin/static.glb"
    assert (plain.drive / world).read_bytes() != (odd.drive / world).read_bytes()
    assert (base / world).read_bytes() == (plain.drive / world).read_bytes()


@pytest.mark.parametrize("nuisance", ["label_jitter_track", "label_jitter_frame", "pose_drift"])
def test_nuisances_move_poses_by_centimetres(base: Path, nuisance: str) -> None:
    true = read_frames(base)
    written = written_frames(true, (nuisance,), np.random.default_rng(0))
    for before, after in zip(true, written, strict=True):
        moved = [
            np.linalg.norm(np.subtract(one["pose"], other["pose"])[:3, 3])
            for one, other in zip(
                [before["ego"], *before["instances"]], [after["ego"], *after["instances"]], strict=True
            )
        ]
        of_ego, of_others = moved[0], np.array(moved[1:])
        if nuisance == "pose_drift":
            assert 0 < of_ego < 0.1
            assert not of_others.any()
        else:
            assert of_ego == 0
            assert 0.02 < of_others.mean() < 0.1


@pytest.mark.parametrize(("nuisance", "factor"), [("usual", 1.0), ("harder", 1.5)])
def test_usual_nuisances_are_as_large_as_they_say(base: Path, nuisance: str, factor: float) -> None:
    true = read_frames(base)
    seeds = [written_frames(true, (nuisance,), np.random.default_rng(seed)) for seed in range(6)]
    scans, turns, objects, paints = [], [], [], []
    for written in seeds:
        for before, after in zip(true, written, strict=True):
            error = _error(before["ego"], after["ego"])
            scans.append(error[:3, 3])
            turns.append(np.degrees([error[2, 1], error[0, 2], error[1, 0]]))
            for one, other in zip(before["instances"], after["instances"], strict=True):
                objects.append(_error(one, other)[:3, 3])
                paints.append(other["paint"] / one["paint"] - 1)
    np.testing.assert_allclose(np.std(scans, axis=0), 0.01 * factor, rtol=0.25)
    np.testing.assert_allclose(np.std(turns, axis=0), 0.02 * factor, rtol=0.25)
    np.testing.assert_allclose(np.std(objects, axis=0), 0.02 * factor, rtol=0.15)
    assert np.std(paints) == pytest.approx(0.05 * factor, rel=0.25)
    of_scans = np.array(scans).reshape(len(seeds), -1, 3)
    assert abs(np.mean(of_scans[:, 1:] * of_scans[:, :-1])) < 0.3 * np.mean(of_scans**2)  # each scan on its own


def test_an_object_keeps_nine_tenths_of_its_error(base: Path) -> None:
    true = [read_frames(base, 1)[0] for _ in range(12)]
    written = written_frames(true, ("usual",), np.random.default_rng(0))
    tracks: dict[str, list[np.ndarray]] = {}
    for before, after in zip(true, written, strict=True):
        for one, other in zip(before["instances"], after["instances"], strict=True):
            tracks.setdefault(one["id"], []).append(_error(one, other)[:3, 3])
    assert len(tracks) > 10
    changing = np.mean([np.var(errors, axis=0, ddof=1) for errors in tracks.values()])
    assert changing == pytest.approx(0.1 * 0.02**2, rel=0.2)


def test_a_fifth_of_what_stands_tall_is_moved_as_a_whole(base: Path, tmp_path: Path) -> None:
    source, target = base / "twin/static.glb", tmp_path / "moved.glb"
    move_tall_things(source, target, np.random.default_rng(0))
    (before, triangles), (after, _) = read_triangles(source), read_triangles(target)
    shift = after.astype(float) - before
    moved = np.linalg.norm(shift, axis=1)
    assert 0 < (moved > 0).mean() < 0.4
    assert moved[moved > 1e-3].min() > 0.0199 and moved.max() < 0.0501
    np.testing.assert_array_equal(shift[:, 1], 0)  # up, in the file's axes
    corners = shift[triangles]
    assert np.abs(corners - corners[:, :1]).max() < 2e-4  # no triangle is bent: float32 far from the origin


def test_foreign_names_change_no_surface(base: Path, tmp_path: Path, bench: Bench) -> None:
    made = make_drive(base, tmp_path / "drive", replace(_SMALL, firings=60, every_ring=8, foreign=True, frames=1))
    twin = Twin(made.drive / "twin")
    assert not set(twin.table.names) & set(bench.twin.table.names)
    rays = bench.bare.aim.rays(bench.frame)
    origin, direction = rays[0], rays[1][::50]
    (solid, _), (same, _) = (
        world.cast(bench.frame, origin, direction, 0.0, (0.9, 50.0)) for world in (twin, bench.twin)
    )
    np.testing.assert_array_equal(solid.distance, same.distance)
    hit = solid.material >= 0
    ours, theirs = twin.table.reflectance[solid.material], bench.twin.table.reflectance[same.material]
    np.testing.assert_array_equal(ours[hit], theirs[hit])


def test_noise_floor_is_that_of_the_noise_distribution(base: Path, tmp_path: Path) -> None:
    hidden = replace(_SMALL, noise=True, frames=1, range_law="laplace")
    made = make_drive(base, tmp_path / "drive", hidden)
    floor = noise_floor(hidden.truth, made.drive, [0])
    # E|x − x'|/2 of a Laplace distribution of standard deviation σ is 3/4·σ/√2.
    assert floor.channels["range"] == pytest.approx(0.75 * 0.02 / 2**0.5, rel=0.05)
    assert floor.channels["drop"] == 0
    assert floor.channels["spurious"] == 0


def _error(before: dict, after: dict) -> np.ndarray:
    return np.linalg.inv(np.array(before["pose"])) @ np.array(after["pose"])


def _by_beam(drive: Path, name: str) -> dict[tuple[int, int], tuple[float, float]]:
    points = np.fromfile(drive / "velodyne" / f"{name}.bin", "<f4").reshape(-1, 4)
    with np.load(drive / "rays" / f"{name}.npz") as rays:
        ring, azimuth = rays["ring"].tolist(), np.round(rays["azimuth"] * 1e4).astype(int).tolist()
    report = zip(np.linalg.norm(points[:, :3], axis=1).tolist(), points[:, 3].tolist(), strict=True)
    return dict(zip(zip(ring, azimuth, strict=True), report, strict=True))
