"""What bad input to `cosim variants` gets: one clear line and exit code 2."""

import shutil

import numpy as np
import pytest

from cosim.variants import make_variants
from tests.cosim.conftest import cosim, refused

RAISES = '''
from typing import ClassVar

from sensors.effects import PointEffect


class Broken(PointEffect):
    """Never works."""

    name: ClassVar = "broken"
    channel: ClassVar = "range"

    def apply(self, returns, shot, rng):
        raise RuntimeError("out of ideas")
'''
NOT_A_NUMBER = RAISES.replace(
    'raise RuntimeError("out of ideas")', "return replace(returns, range_m=returns.range_m / 0 * 0)"
)
NOT_A_NUMBER = NOT_A_NUMBER.replace("from typing", "from dataclasses import replace\nfrom typing")


def refusal(*arguments):
    with np.errstate(all="ignore"):
        return refused("variants", *map(str, arguments), "--quiet")


@pytest.mark.parametrize(
    ("variant", "complaint"),
    [
        ("duall", "'duall' does not exist"),
        ("dual,dual", "two variants would be written to dual/"),
        (",", "names no sensor"),
    ],
)
def test_an_unknown_or_doubled_variant(hamlet_drive, tmp_path, variant, complaint):
    assert complaint in refusal(hamlet_drive, "--variant", variant, "--out", tmp_path / "v")
    assert not (tmp_path / "v").exists()


def test_an_unknown_effect_in_a_sensor_file(hamlet_drive, tmp_path):
    (tmp_path / "my.yaml").write_text("pattern: vlp16\neffects: [{effect: range_nois}]\n")
    line = refusal(hamlet_drive, "--variant", tmp_path / "my.yaml", "--out", tmp_path / "v")
    assert "did you mean range_noise" in line


@pytest.mark.parametrize(("source", "complaint"), [(RAISES, "out of ideas"), (NOT_A_NUMBER, "NaN or infinity")])
def test_an_effect_that_raises_or_gives_nonsense(hamlet_drive, tmp_path, source, complaint):
    (tmp_path / "broken.py").write_text(source)
    (tmp_path / "my.yaml").write_text("pattern: vlp16\neffects: [{effect: ./broken.py:Broken}]\n")
    line = refusal(hamlet_drive, "--variant", tmp_path / "my.yaml", "--out", tmp_path / "v")
    assert complaint in line and "broken.py" in line
    assert not list((tmp_path / "v").rglob("*.bin"))


def test_a_drive_without_hits_or_without_anything(hamlet_drive, tmp_path):
    bare = tmp_path / "bare"
    shutil.copytree(hamlet_drive, bare, ignore=shutil.ignore_patterns("hits"))
    assert "no hits/000000.npz" in refusal(bare, "--variant", "strongest", "--out", tmp_path / "v")
    assert "no such folder" in refusal(tmp_path / "none", "--variant", "strongest", "--out", tmp_path / "v")


def test_a_drive_without_its_twin_where_new_rays_are_needed(hamlet_drive, tmp_path):
    bare = tmp_path / "bare"
    shutil.copytree(hamlet_drive, bare, ignore=shutil.ignore_patterns("static.glb"))
    assert "static" in refusal(bare, "--variant", "dual", "--out", tmp_path / "v")


def test_a_folder_that_holds_something_else(hamlet_drive, tmp_path):
    other = tmp_path / "other"
    shutil.copytree(hamlet_drive, other, ignore=shutil.ignore_patterns("image_*", "depth_*"))
    (other / "manifest.jsonl").write_text("".join((hamlet_drive / "manifest.jsonl").open().readlines()[:3]))
    make_variants(other, "vlp16", tmp_path / "v")
    assert "other settings" in refusal(hamlet_drive, "--variant", "vlp16", "--out", tmp_path / "v")
    assert "is inside the drive" in refusal(hamlet_drive, "--variant", "vlp16", "--out", hamlet_drive / "v")
    (tmp_path / "w/vlp16").mkdir(parents=True)
    (tmp_path / "w/vlp16/notes.txt").write_text("mine")
    assert "holds no drive" in refusal(hamlet_drive, "--variant", "vlp16", "--out", tmp_path / "w")


def test_the_picture_shows_every_variant(variants_folder, source_drive, tmp_path):
    cosim(
        *("variants", source_drive, "--variant", "all", "--out", variants_folder, "--quiet"),
        *("--picture", tmp_path / "p.png", "--beside", source_drive),
    )
    assert (tmp_path / "p.png").stat().st_size > 500_000
