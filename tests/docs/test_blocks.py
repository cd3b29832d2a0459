"""Commands and code on the documentation pages work as written."""

from __future__ import annotations

import pytest
import yaml

from tests.docs.blocks import LANGUAGES, Block, pages, read_blocks

ALL = [block for page in pages() for block in read_blocks(page)]


def _cases(when: str) -> list[object]:
    marks = (pytest.mark.slow,) if when == "slow" else ()
    here = [page for page in pages() if any(block.acts and block.when == when for block in ALL if block.page == page)]
    return [pytest.param(page, when, marks=marks, id=f"{page}-{when}") for page in here]


@pytest.mark.parametrize(("page", "when"), [*_cases("quick"), *_cases("slow")])
def test_blocks_work_as_written(page: str, when: str, page_folder):
    """A page's blocks are one test, because later ones need what earlier ones leave."""
    for block in read_blocks(page):
        if block.acts and block.when == when:
            page_folder(page).reach(block)


@pytest.mark.parametrize("block", [pytest.param(b, id=f"{b.page}:{b.line}") for b in ALL if b.when == "never"])
def test_blocks_that_are_not_run_say_why(block: Block):
    assert len(block.reason.split()) > 2, f"{block.page}:{block.line}"


@pytest.mark.parametrize("page", pages())
def test_every_block_says_what_it_is(page: str):
    for block in read_blocks(page):
        assert block.language in LANGUAGES, f"{page}:{block.line}: ```{block.language} is not one of {LANGUAGES}"


@pytest.mark.parametrize("page", pages())
def test_yaml_is_yaml(page: str):
    for block in read_blocks(page):
        if block.language == "yaml":
            assert yaml.safe_load(block.body), f"{page}:{block.line}"
