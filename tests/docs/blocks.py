"""Fenced blocks of Markdown pages, and what a comment above each says about running it.

Blocks of `bash` and `python` are run, in order, in one folder a page; what one block of Python imports, later ones
have. Blocks with a title are files, and written:
a `yaml` fence with `title="my.yaml"` becomes `my.yaml`. A comment in the line above a fence may say

    run: slow                      takes long: by `make slow` only
    run: with 1500 → 3             run with the words replaced
    run: slow, with 1500 → 3       both
    run: no, because REASON        shown, not run; tests report it with its reason

and one anywhere in the page, `given: NAME is PROVIDER`, that something lies in the folder from the start.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

ROOT = Path(__file__).resolve().parents[2]
LANGUAGES = {"bash", "python", "yaml", "json", "toml", "text", "xml"}
RUNNABLE = ("bash", "python")
STORIES = {"docs/tutorial.md"}  # each block needs those before it, and the whole takes minutes: all are slow

_FENCE = re.compile(r"^(?P<indent> *)```(?P<language>\w*)(?P<rest>[^\n`]*)$")
_TITLE = re.compile(r'title="([^"]+)"')
_COMMENT = re.compile(r"^\s*<!-- run: (.*) -->$")
_GIVEN = re.compile(r"<!-- given: (\S+) is (\w+) -->")


@dataclass(frozen=True)
class Block:
    """A fenced block.

    Attributes:
        page: path of the page, relative to the repository.
        line: of its opening fence, from 1.
        language: after the fence.
        title: name of the file it is; empty if it is none.
        body: its text.
        when: whether it is run by quick tests, by slow ones, or not at all.
        reason: why it is not run.
        smaller: words and what they are replaced with when it is run.
    """

    page: str
    line: int
    language: str
    title: str
    body: str
    when: Literal["quick", "slow", "never"]
    reason: str = ""
    smaller: tuple[tuple[str, str], ...] = ()

    @property
    def acts(self) -> bool:
        """Whether something is to be done for it: a file to write, a program to run."""
        return bool(self.title) or self.language in RUNNABLE

    @property
    def program(self) -> str:
        """What is run."""
        text = self.body
        for word, other in self.smaller:
            assert word in text, f"{self.page}:{self.line}: nothing to replace: {word!r}"
            text = re.sub(rf"(?<!\w){re.escape(word)}(?!\w)", other, text)
        return text


def pages() -> list[str]:
    """Paths of all pages whose blocks are tried."""
    return ["README.md", "CONTRIBUTING.md", *sorted(str(p.relative_to(ROOT)) for p in (ROOT / "docs").rglob("*.md"))]


def read_blocks(page: str) -> list[Block]:
    """All fenced blocks of a page."""
    lines = (ROOT / page).read_text(encoding="utf-8").split("\n")
    blocks, at = [], 0
    while at < len(lines):
        opening = _FENCE.match(lines[at])
        if opening is None:
            at += 1
            continue
        end = next(i for i in range(at + 1, len(lines)) if lines[i].strip() == "```")
        indent = len(opening["indent"])
        body = "\n".join(line[indent:] for line in lines[at + 1 : end]) + "\n"
        title = _TITLE.search(opening["rest"])
        message = _COMMENT.match(lines[at - 1]) if at else None
        plain = "slow" if page in STORIES else ""
        when, reason, smaller = _plan(message[1] if message else plain, f"{page}:{at + 1}")
        name = title[1] if title else ""
        blocks.append(Block(page, at + 1, opening["language"], name, body, when, reason, smaller))
        at = end + 1
    return blocks


def given(page: str) -> dict[str, str]:
    """What lies in a page's folder from the start: name and who provides it."""
    return dict(_GIVEN.findall((ROOT / page).read_text(encoding="utf-8")))


def _plan(said: str, where: str) -> tuple[Literal["quick", "slow", "never"], str, tuple[tuple[str, str], ...]]:
    if said.startswith("no"):
        reason = said.removeprefix("no, because ")
        assert reason != said and reason, f"{where}: write `run: no, because REASON`"
        return "never", reason, ()
    when, _, words = said.partition("with ")
    assert when.strip(", ") in ("", "slow"), f"{where}: cannot read `run: {said}`"
    pairs = [tuple(part.split(" → ")) for part in words.split(", ")] if words else []
    assert all(len(pair) == 2 for pair in pairs), f"{where}: write `with WORD → WORD, …`"
    return ("slow" if "slow" in when else "quick"), "", tuple((pair[0], pair[1]) for pair in pairs)
