"""What the pages tell users to type works as it is written."""

from __future__ import annotations

import pytest
import yaml

from tests.docs.blocks import LANGUAGES, Block, pages, read_blocks

ALL = [block for page in pages() for block in read_blocks(page)]


def _case(block: Block) -> object:
    marks = {
        "quick": (pytest.mark.xdist_group("drive"),),
        "slow": (pytest.mark.slow, pytest.mark.xdist_group(block.page)),
        "never": (pytest.mark.skip(reason=f"not run, because {block.reason}"),),
    }
    return pytest.param(block, marks=marks[block.when], id=f"{block.page}:{block.line}")


@pytest.mark.parametrize("block", [_case(block) for block in ALL if block.acts])
def test_a_block_works_as_written(block: Block, page_folder):
    page_folder(block.page).reach(block)


@pytest.mark.parametrize("page", pages())
def test_every_block_says_what_it_is(page: str):
    for block in read_blocks(page):
        assert block.language in LANGUAGES, f"{page}:{block.line}: ```{block.language} is not one of {LANGUAGES}"


@pytest.mark.parametrize("page", pages())
def test_yaml_is_yaml(page: str):
    for block in read_blocks(page):
        if block.language == "yaml":
            assert yaml.safe_load(block.body), f"{page}:{block.line}"
