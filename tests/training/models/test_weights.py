"""Weights of other frameworks load under their own names; of other architectures they are refused by name."""

from __future__ import annotations

import re

import pytest

torch = pytest.importorskip("torch")

from training.checkpoints import load_detector, load_weights, save_checkpoint  # noqa: E402
from training.errors import TrainingError  # noqa: E402
from training.models.build import build_detector  # noqa: E402
from training.models.settings import ModelSettings  # noqa: E402

_CLASSES = ("Car", "Pedestrian", "Cyclist")
_TINY = ModelSettings.model_validate({"layers": [1, 1, 1], "channels": [8, 8, 8], "upsample_channels": [8, 8, 8]})


@pytest.fixture(scope="module")
def published():
    torch.manual_seed(0)
    return build_detector(ModelSettings.model_validate("pointpillars"), _CLASSES)


def in_their_names(weights: dict) -> dict:
    """Our weights as mmdetection3d would have stored them."""
    theirs = {}
    for key, value in weights.items():
        key = key.replace("vfe.", "voxel_encoder.").replace("backbone_2d.deblocks", "neck.deblocks")
        stage = re.match(r"backbone_2d\.blocks\.(\d)\.(\d+)\.(.*)", key)
        if stage:
            key = f"backbone.blocks.{stage[1]}.{int(stage[2]) - 1}.{stage[3]}"
        key = key.replace("dense_head.conv_box", "bbox_head.conv_reg").replace("dense_head.", "bbox_head.")
        if key.startswith("bbox_head."):
            each = value.reshape(3, 2, -1, *value.shape[1:])[[1, 2, 0]]
            value = (each[:, :, [1, 2, 0]] if "conv_cls" in key else each).reshape(value.shape)
        theirs[key] = value
    return theirs


def test_pointpillars_has_the_published_parameters(published):
    shapes = {name: tuple(value.shape) for name, value in published.state_dict().items()}
    assert sum(value.numel() for value in published.parameters()) == 4_834_888
    assert shapes["vfe.pfn_layers.0.linear.weight"] == (64, 10)
    assert shapes["backbone_2d.blocks.2.1.weight"] == (256, 128, 3, 3)
    assert shapes["backbone_2d.deblocks.2.0.weight"] == (256, 128, 4, 4)
    assert shapes["dense_head.conv_box.weight"] == (42, 384, 1, 1)


def test_openpcdets_layout_loads_as_it_is(published, tmp_path):
    weights = {**published.state_dict(), "global_step": torch.zeros(1)}
    torch.save({"model_state": weights, "epoch": 80, "version": "pcdet"}, tmp_path / "openpcdet.pth")
    detector, classes = load_detector(tmp_path / "openpcdet.pth")
    assert classes == _CLASSES
    for name, value in published.state_dict().items():
        assert torch.equal(detector.state_dict()[name], value), name


def test_mmdetection3ds_layout_is_renamed_and_its_classes_reordered(published, tmp_path):
    torch.save({"state_dict": in_their_names(published.state_dict())}, tmp_path / "theirs.pth")
    detector, _ = load_detector(tmp_path / "theirs.pth")
    for name, value in published.state_dict().items():
        assert torch.equal(detector.state_dict()[name], value), name


def test_another_architecture_is_refused_naming_the_keys(tmp_path):
    detector = build_detector(_TINY, ("Car",))
    wider = build_detector(_TINY.model_copy(update={"pillar_channels": 16}), ("Car",))
    save_checkpoint(tmp_path / "wider.pt", wider, _TINY, ("Car",))
    with pytest.raises(TrainingError, match=r"vfe\.pfn_layers\.0\.linear\.weight is \(16, 10\), not \(32, 10\)"):
        load_weights(detector, tmp_path / "wider.pt", ("Car",))
    torch.save({"model_state": {"first": torch.zeros(2)}}, tmp_path / "other.pth")
    with pytest.raises(TrainingError, match=r"missing .*1 unknown \(first\)"):
        load_weights(detector, tmp_path / "other.pth", ("Car",))
    (tmp_path / "junk.pth").write_bytes(b"junk")
    with pytest.raises(TrainingError, match="not a checkpoint"):
        load_weights(detector, tmp_path / "junk.pth", ("Car",))


def test_ours_tell_their_model_and_classes(tmp_path):
    detector = build_detector(_TINY, ("Car",))
    save_checkpoint(tmp_path / "ours.pt", detector, _TINY, ("Car",), step=3)
    again, classes = load_detector(tmp_path / "ours.pt")
    assert classes == ("Car",)
    for name, value in detector.state_dict().items():
        assert torch.equal(again.state_dict()[name], value)


def test_a_checkpoint_that_lacks_a_part_or_comes_from_another_version_says_so(tmp_path):
    detector = build_detector(_TINY, ("Car",))
    save_checkpoint(tmp_path / "ours.pt", detector, _TINY, ("Car",))
    content = torch.load(tmp_path / "ours.pt", weights_only=True)
    torch.save({**content, "model": {**content["model"], "wings": 2}}, tmp_path / "newer.pt")
    torch.save({key: value for key, value in content.items() if key != "classes"}, tmp_path / "part.pt")
    with pytest.raises(TrainingError, match=r"wings.*another version"):
        load_detector(tmp_path / "newer.pt")
    with pytest.raises(TrainingError, match="contains no classes"):
        load_weights(detector, tmp_path / "part.pt", ("Car",))


def test_voxel_rcnn_has_the_published_parameters():
    detector = build_detector(ModelSettings.model_validate("voxel_rcnn"), ("Car",))
    shapes = {name: tuple(value.shape) for name, value in detector.state_dict().items()}
    assert shapes["backbone_3d.conv_input.0.weight"] == (16, 3, 3, 3, 4)
    assert shapes["backbone_3d.conv4.0.0.weight"] == (64, 3, 3, 3, 64)
    assert shapes["backbone_3d.conv_out.0.weight"] == (128, 3, 1, 1, 64)
    assert shapes["backbone_2d.blocks.0.1.weight"] == (64, 256, 3, 3)
    assert shapes["roi_head.roi_grid_pool_layers.0.mlps_in.0.0.weight"] == (32, 32, 1)
    assert shapes["roi_head.shared_fc_layer.0.weight"] == (256, 96 * 6**3)
    assert shapes["roi_head.shared_fc_layer.4.weight"] == (256, 256)
    assert shapes["roi_head.reg_pred_layer.weight"] == (7, 256)
