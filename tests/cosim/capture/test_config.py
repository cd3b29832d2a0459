import pytest

from cosim.capture.config import ConfigError, load_config


def test_the_command_line_wins_over_the_file(tmp_path):
    path = tmp_path / "run.yaml"
    path.write_text("town: town01\nseed: 4\nframes: 7\n")
    config = load_config(path, seed=9, frames=None)
    assert (config.town, config.seed, config.frames) == ("town01", 9, 7)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("frame: 10\n", "unknown key 'frame'.*known keys are town, frames"),
        ("frames: 0\n", "frames: .*greater than or equal to 1.*got 0"),
        ("frames: many\n", "frames: .*got 'many'"),
        ("seed: -3\n", "seed: .*got -3"),
        ("backend: opengl\n", "backend: .*'osmesa' or 'egl'.*got 'opengl'"),
        ("- a\n- b\n", "contains list"),
        ("a: [1\n", "is not YAML"),
    ],
)
def test_a_bad_configuration_is_one_line_with_the_value_and_the_remedy(tmp_path, text, complaint):
    path = tmp_path / "run.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=complaint) as caught:
        load_config(path)
    assert "\n" not in str(caught.value) and "run.yaml" in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"cannot read .*nowhere\.yaml"):
        load_config(tmp_path / "nowhere.yaml")
