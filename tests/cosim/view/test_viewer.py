"""The page in a browser: it draws, it obeys slider and keys, it shows what there is and says what there is not."""

from __future__ import annotations

import base64
import re
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cosim.drives.kitti import Drive, encode_rgb
from cosim.view.interactive import ViewServer, show_drives, write_interactive
from sensors.effects.registry import find_effect
from tests.cosim.discrepancy.small_drive import Yard, make_yard
from tests.cosim.view.chromium import Chromium

_SPACE = "cosimView.panes[{pane}].space.scene"
_DRAWN = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done))))"


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chromium]:
    browser = Chromium(tmp_path_factory.mktemp("profile"))
    yield browser
    browser.close()


@pytest.fixture(autouse=True)
def no_faults(browser: Chromium) -> Iterator[None]:
    browser.faults.clear()
    browser.requests.clear()
    yield
    assert browser.faults == []


@pytest.fixture(scope="module")
def yard(tmp_path_factory: pytest.TempPathFactory) -> Yard:
    effect = find_effect("range_bias").model_validate({"offset_m": 0.04})
    return make_yard(tmp_path_factory.mktemp("yard"), (effect,), frames=3)


def written(page: Path, *drives: Path, sensor: Path | None = None, frames: str | None = None) -> str:
    shown = show_drives(
        [Drive(drive) for drive in drives], frames, 12, str(sensor) if sensor is not None else None, for_file=True
    )
    write_interactive(shown, page)
    return page.as_uri()


def pixels(browser: Chromium, pane: int = 0) -> np.ndarray:
    """What WebGL has drawn, (h, w, 4)."""
    scene = _SPACE.format(pane=pane)
    browser.wait("cosimView.ready")
    browser.evaluate(_DRAWN)
    browser.evaluate(f"{scene}.draw()")
    width, height = browser.evaluate(f"[{scene}.canvas.width, {scene}.canvas.height]")
    values = browser.evaluate(
        f"(() => {{ const gl = {scene}.gl, out = new Uint8Array({width * height * 4}); let text = '';"
        f"gl.readPixels(0, 0, {width}, {height}, gl.RGBA, gl.UNSIGNED_BYTE, out);"
        "for (const value of out) text += String.fromCharCode(value); return btoa(text); })()"
    )
    return np.frombuffer(base64.b64decode(values), np.uint8).reshape(height, width, 4)


def differing(one: np.ndarray, other: np.ndarray) -> int:
    return int((one != other).any(-1).sum())


def frame_shown(browser: Chromium) -> str:
    """What the page says of its frame, once that is drawn: canvases follow with the browser's next picture."""
    browser.wait("cosimView.ready")
    browser.evaluate(_DRAWN)
    return browser.evaluate("document.querySelector('.facts').textContent")


def test_one_file_opens_by_itself_and_draws_points(browser: Chromium, labelled_drive: Path, tmp_path: Path) -> None:
    address = written(tmp_path / "page.html", labelled_drive)
    browser.open(address)
    image = pixels(browser)
    coloured = (np.ptp(image[..., :3].astype(int), axis=-1) > 40).sum()
    assert coloured > 500
    assert [one for one in browser.requests if not one.startswith(("blob:", "data:"))] == [address]


def test_keys_and_slider_change_the_frame(browser: Chromium, labelled_drive: Path, tmp_path: Path) -> None:
    browser.open(written(tmp_path / "page.html", labelled_drive))
    shown = [frame_shown(browser)]
    for key in ("ArrowRight", "ArrowRight", "ArrowRight", "ArrowLeft", "Home", "End"):
        browser.press(key)
        shown.append(frame_shown(browser))
    numbers = [int(text[len("frame ") :][:6]) for text in shown]
    assert numbers == [0, 1, 2, 2, 1, 0, 2]
    assert "labels 1 Car" in shown[1] and "labels" not in shown[0]
    browser.evaluate("slider.value = 1; slider.dispatchEvent(new Event('input'))")
    assert "000001" in frame_shown(browser)
    assert browser.evaluate("location.hash") == "#000001"


@pytest.mark.parametrize(("ending", "index"), [("#000002", 2), ("#000009", 0), ("#%", 0)])
def test_a_link_opens_at_its_frame(
    browser: Chromium, labelled_drive: Path, tmp_path: Path, ending: str, index: int
) -> None:
    browser.open(written(tmp_path / "page.html", labelled_drive) + ending)
    assert browser.evaluate("cosimView.index") == index


def test_space_plays_and_stops(browser: Chromium, labelled_drive: Path, tmp_path: Path) -> None:
    browser.open(written(tmp_path / "page.html", labelled_drive))
    browser.press(" ")
    browser.wait("cosimView.index === 2")
    browser.wait("cosimView.index === 0")
    browser.press(" ")
    browser.wait("cosimView.ready && !cosimView.timer")


def test_every_mode_of_colours_paints_another_picture(browser: Chromium, yard: Yard, tmp_path: Path) -> None:
    browser.open(written(tmp_path / "page.html", yard.drive, sensor=yard.sensor))
    pictures = []
    for key, title in enumerate(("Intensity", "Range", "Ring", "Object", "Material", "Residual"), 1):
        browser.press(str(key))
        pictures.append(pixels(browser))
        assert browser.evaluate("document.querySelector('.legend').textContent").startswith(title)
    for row, one in enumerate(pictures):
        for other in pictures[:row]:
            assert differing(one, other) > 500
    assert "[cm]" in browser.evaluate("document.querySelector('.legend').textContent")
    red, blue = (pictures[5][..., band].astype(int) for band in (0, 2))
    assert (red - blue > 60).sum() > 20 * (blue - red > 60).sum()  # 4 cm too far


def test_noise_about_zero_is_recognised_however_points_overlap(browser: Chromium, tmp_path: Path) -> None:
    noise = {"effect": "range_noise", "sigma_m": 0.02}
    effect = find_effect("range_noise").model_validate({"sigma_m": 0.02})
    noisy = make_yard(tmp_path / "yard", (effect,), known=(noise,), frames=1)
    browser.open(written(tmp_path / "page.html", noisy.drive, sensor=noisy.sensor))
    browser.press("6")
    for _ in range(8):
        browser.press("+")
    browser.evaluate("cosimView.orbit.look({target: [10, 22, 0], yaw: Math.PI / 2, pitch: 0, away: 120})")  # a wall
    drawn = pixels(browser).astype(int)
    # a quarter of the way from the middle to the ends of the scale, and beyond
    farther, nearer = (drawn[..., 0] - drawn[..., 2] > 79).sum(), (drawn[..., 2] - drawn[..., 0] > 60).sum()
    assert farther > 1000
    assert 0.8 < farther / nearer < 1.25


def test_modes_that_cannot_be_had_are_greyed_and_say_why(
    browser: Chromium, labelled_drive: Path, tmp_path: Path
) -> None:
    browser.open(written(tmp_path / "page.html", labelled_drive))
    greyed = browser.evaluate("[...document.querySelectorAll('[data-mode]')].filter(one => one.disabled)"
                              ".map(one => [one.dataset.mode, one.title])")  # fmt: skip
    assert [mode for mode, _ in greyed] == ["instance", "material", "residual"]
    assert "twin" in greyed[2][1]
    browser.press("6")
    assert browser.evaluate("cosimView.look.mode.name") == "intensity"
    browser.press("ArrowRight")
    frame_shown(browser)
    assert not browser.evaluate("document.querySelector('[data-mode=instance]').disabled")


def test_boxes_and_points_in_the_image_come_and_go(browser: Chromium, labelled_drive: Path, tmp_path: Path) -> None:
    browser.open(written(tmp_path / "page.html", labelled_drive, frames="000001"))
    image = "document.querySelector('.image canvas').toDataURL()"
    with_boxes, in_image = pixels(browser), browser.evaluate(image)
    browser.press("b")
    browser.press("b")
    without = pixels(browser)
    assert 100 < differing(with_boxes, without) < 20_000
    without_in_image = browser.evaluate(image)
    assert without_in_image != in_image
    browser.press("p")
    pixels(browser)
    assert browser.evaluate(image) != without_in_image


def test_the_wheel_enlarges_the_image_about_the_pointer(
    browser: Chromium, labelled_drive: Path, tmp_path: Path
) -> None:
    browser.open(written(tmp_path / "page.html", labelled_drive, frames="000001"))
    browser.evaluate(_DRAWN)
    x, y = browser.evaluate(
        "(() => { const box = document.querySelector('.image canvas').getBoundingClientRect();"
        "return [box.left + box.width / 4, box.top + box.height / 2]; })()"
    )
    browser.scroll(x, y, -1000)
    browser.wait("cosimView.look.part.scale > 2")
    part = browser.evaluate("cosimView.look.part")
    assert abs(part["x"] + 0.25 / part["scale"] - 0.25) < 0.01  # what was under the pointer is still there
    browser.scroll(x, y, 5000)
    browser.wait("cosimView.look.part.scale === 1 && cosimView.look.part.x === 0")


def test_dragging_turns_and_r_goes_back(browser: Chromium, labelled_drive: Path, tmp_path: Path) -> None:
    browser.open(written(tmp_path / "page.html", labelled_drive))
    before = pixels(browser)
    browser.drag((700, 200), (800, 240))
    turned = browser.evaluate("[cosimView.orbit.yaw, cosimView.orbit.pitch]")
    assert abs(turned[0] + 0.6) < 0.05 and turned[1] > 0.5
    assert differing(before, pixels(browser)) > 500
    browser.press("r")
    assert differing(before, pixels(browser)) == 0
    browser.press("t")
    assert browser.evaluate("cosimView.orbit.pitch") > 1.5


def test_a_point_under_the_pointer_shows_its_values(browser: Chromium, labelled_drive: Path, tmp_path: Path) -> None:
    browser.open(written(tmp_path / "page.html", labelled_drive, frames="000001"))
    pixels(browser)
    position = browser.evaluate(
        "(() => { const scene = cosimView.panes[0].space.scene, m = scene.matrix, [x, y, z] = [11, 2, -0.9];"
        "const w = m[3] * x + m[7] * y + m[11] * z + m[15], box = scene.canvas.getBoundingClientRect();"
        "return [((m[0] * x + m[4] * y + m[8] * z + m[12]) / w + 1) / 2 * box.width + box.left,"
        "(1 - (m[1] * x + m[5] * y + m[9] * z + m[13]) / w) / 2 * box.height + box.top]; })()"
    )
    browser.point(*position)
    browser.wait("!document.querySelector('.tip').hidden")
    message = browser.evaluate("document.querySelector('.tip').textContent")
    assert "range 11." in message and "Car: visible" in message and "intensity" in message


def test_two_drives_stand_side_by_side_with_one_eye_and_one_slider(
    browser: Chromium, labelled_drive: Path, tmp_path: Path
) -> None:
    other = tmp_path / "other"
    shutil.copytree(labelled_drive, other)
    (other / "image_2" / "000001.png").write_bytes(encode_rgb(np.full((80, 200, 3), 200, np.uint8)))
    browser.open(written(tmp_path / "page.html", labelled_drive, other))
    assert browser.evaluate("document.querySelectorAll('.pane').length") == 2
    before = [pixels(browser, pane) for pane in (0, 1)]
    assert differing(*before) == 0  # the same points from the same place
    browser.drag((300, 200), (400, 240))
    after = [pixels(browser, pane) for pane in (0, 1)]
    assert differing(before[0], after[0]) > 500 and differing(*after) == 0
    browser.press("ArrowRight")
    frame_shown(browser)
    facts = browser.evaluate("[...document.querySelectorAll('.facts')].map(one => one.textContent)")
    assert all("000001" in text for text in facts)
    images = browser.evaluate("[...document.querySelectorAll('.image canvas')].map(one => one.toDataURL())")
    assert images[0] != images[1]


def test_a_drive_of_points_alone_is_shown(browser: Chromium, bare_drive: Path, tmp_path: Path) -> None:
    (bare_drive / "velodyne" / "000002.bin").write_bytes(b"")
    browser.open(written(tmp_path / "page.html", bare_drive))
    assert "no camera images" in browser.evaluate("document.querySelector('.no-image:not([hidden])').textContent")
    assert "label_2/ is absent" in browser.evaluate("document.querySelector('details').textContent")
    browser.press("End")
    assert "points 0" in frame_shown(browser)


def test_no_name_becomes_markup(browser: Chromium, bare_drive: Path, tmp_path: Path) -> None:
    nasty = tmp_path / "<img src=x onerror=alert(1)>'&\""
    bare_drive.rename(nasty)
    browser.open(written(tmp_path / "page.html", nasty))
    assert nasty.name in browser.evaluate("document.querySelector('h1').textContent")
    assert browser.evaluate("document.querySelectorAll('img').length") == 0


def test_a_served_page_traces_when_residuals_are_requested(browser: Chromium, yard: Yard) -> None:
    shown = show_drives([Drive(yard.drive)], None, None, str(yard.sensor), for_file=False)
    with ViewServer(shown) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))
        thread.start()
        browser.open(server.address)
        plain = pixels(browser)
        assert not any("/extra/" in one for one in browser.requests)
        browser.press("6")
        browser.wait("cosimView.ready && document.querySelector('.legend').textContent.startsWith('Residual')")
        assert differing(plain, pixels(browser)) > 500
        assert any("/extra/0/000000" in one for one in browser.requests)
        assert all(one.startswith((server.address, "blob:", "data:")) for one in browser.requests)
        server.shutdown()
        thread.join()


def test_real_frames_are_shown_with_boxes_and_image(browser: Chromium, kitti_root: Path, tmp_path: Path) -> None:
    browser.open(written(tmp_path / "page.html", kitti_root))
    assert re.search(r"points 1\d\d,\d{3}", frame_shown(browser))
    assert (np.ptp(pixels(browser)[..., :3].astype(int), axis=-1) > 40).sum() > 20_000
    assert browser.evaluate("cosimView.panes[0].image.seen.length") > 10_000
    assert browser.evaluate("cosimView.panes[0].image.boxes.length") > 0
