"""Folders of pages, with what the pages take for granted."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from cosim.variants import make_variants
from tests.cosim.conftest import cosim
from tests.docs.blocks import given
from tests.docs.folder import PageFolder, Provide
from tests.sharing import made_once

_BELIEVED = "pattern: hdl64e\neffects:\n  - {effect: range_noise, sigma_m: 0.02}\n"
_TRUE = _BELIEVED + "  - {effect: range_walk, amplitude_m: 0.05, decay: 4}\n"


@pytest.fixture(scope="session")
def providers(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Provide]:
    """By the word of a page's `given`: what lays something into its folder."""

    def drive(target: Path) -> None:
        """Eight frames of town01, simulated."""
        shutil.copytree(request.getfixturevalue("drive_folder"), target)

    def kitti(target: Path) -> None:
        """Three real frames in KITTI's ordinary layout."""
        shutil.copytree(request.getfixturevalue("kitti_root"), target)

    def sensor(target: Path) -> None:
        """What a user believes of his sensor."""
        target.write_text(_BELIEVED)

    def measured(target: Path) -> None:
        """Replacement of measurements: the same drive by a sensor with range walk."""
        source = request.getfixturevalue("drive_folder")

        def measure(folder: Path) -> None:
            (folder / "true.yaml").write_text(_TRUE)
            make_variants(source, str(folder / "true.yaml"), folder / "made")

        shutil.copytree(made_once(tmp_path_factory, "measured", measure) / "made/true", target)

    def tracks(target: Path) -> None:
        """Replacement of measured trajectories: drivers with a lateral offset of 0.3 m."""
        config = target.with_name("measured_traffic.yaml")
        config.write_text("town: town01\nbehaviour: {preset: calm, lane_offset_m: {kind: constant, value: 0.3}}\n")
        cosim("traffic-record", "--config", config, "--seconds", 60, "--out", target, "--quiet")

    return {"drive": drive, "kitti": kitti, "sensor": sensor, "measured": measured, "tracks": tracks}


@pytest.fixture(scope="session")
def page_folder(tmp_path_factory: pytest.TempPathFactory, providers: dict[str, Provide]) -> Callable[[str], PageFolder]:
    """The one folder of each page."""
    folders: dict[str, PageFolder] = {}

    def of(page: str) -> PageFolder:
        if page not in folders:
            wanted = given(page)

            def lay_in(folder: Path) -> None:
                for name, provider in wanted.items():
                    providers[provider](folder / name)

            folders[page] = PageFolder(page, tmp_path_factory.mktemp(Path(page).stem), lay_in)
        return folders[page]

    return of
