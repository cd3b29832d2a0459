"""Folders of pages, with what the pages take for granted."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.docs.blocks import given
from tests.docs.folder import PageFolder, Provide


@pytest.fixture(scope="session")
def providers(request: pytest.FixtureRequest) -> dict[str, Provide]:
    """By the word of a page's `given`: what lays something into its folder."""

    def drive(target: Path) -> None:
        """Eight frames of town01, simulated."""
        shutil.copytree(request.getfixturevalue("drive_folder"), target)

    def kitti(target: Path) -> None:
        """Three real frames in KITTI's ordinary layout."""
        shutil.copytree(request.getfixturevalue("kitti_root"), target)

    return {"drive": drive, "kitti": kitti}


@pytest.fixture(scope="session")
def page_folder(
    tmp_path_factory: pytest.TempPathFactory, providers: dict[str, Provide]
) -> Callable[[str], PageFolder]:
    """The one folder of each page."""
    folders: dict[str, PageFolder] = {}

    def of(page: str) -> PageFolder:
        if page not in folders:
            folder = tmp_path_factory.mktemp(Path(page).stem)
            for name, provider in given(page).items():
                providers[provider](folder / name)
            folders[page] = PageFolder(page, folder)
        return folders[page]

    return of
