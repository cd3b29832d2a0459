"""Files of annotators: lists of label effects."""

from pathlib import Path

import pytest

from sensors.errors import SensorError
from sensors.pattern import load_pattern
from sensors.sensor_file import annotator_names, read_annotator
from sensors.sensor_model import load_sensor

PATTERN = load_pattern("hdl64e")


def test_built_in_annotators():
    assert annotator_names() == ["exact", "kitti"]
    assert read_annotator("exact", PATTERN) == ()
    assert [effect.name for effect in read_annotator("kitti", PATTERN)] == ["box_shrink"]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("pattern: hdl64e\neffects: []", "write only a list of label effects"),
        ("- few_points", "write only a list of label effects"),
        ("effects: [{effect: range_noise, sigma_m: 0.02}]", "range_noise does not change labels"),
        ("effects: [{effect: few_points, points: -1}]", "points"),
        ("effects: [{effect: unknown_effect}]", "unknown_effect"),
        ("effects: {", "cannot be read"),
    ],
)
def test_a_bad_file_is_one_line(tmp_path, text, complaint):
    file = tmp_path / "annotator.yaml"
    file.write_text(text)
    with pytest.raises(SensorError, match=r"^annotator .*annotator") as raised:
        read_annotator(str(file), PATTERN)
    assert complaint in str(raised.value) and "\n" not in str(raised.value)


def test_an_unknown_annotator_and_a_folder(tmp_path: Path):
    for name in ("nobody", str(tmp_path)):
        with pytest.raises(SensorError, match="give exact, kitti or the path of a file"):
            read_annotator(name, PATTERN)


def test_label_effects_come_from_the_sensor_or_the_annotator():
    kitti = read_annotator("kitti", PATTERN)
    assert load_sensor("hdl64e").with_annotator(kitti).relabels
    assert load_sensor("dual").with_annotator(()).relabels
    with pytest.raises(SensorError, match="has label effects already"):
        load_sensor("dual").with_annotator(kitti)
