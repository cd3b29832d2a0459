"""The site builds without a warning, fetches nothing, and its references are complete."""

from __future__ import annotations

import re
import subprocess
import sys
from html import unescape
from pathlib import Path

import pytest

from cosim.capture.config import RunConfig
from cosim.cli.main import make_parser
from cosim.traffic.behaviour import BehaviourConfig
from sensors.effects.registry import built_in_effects
from tests.docs.blocks import ROOT
from tests.docs.folder import environment
from tools.reference_pages import arguments, commands_page, effects_page, subcommands

_FETCHED = re.compile(r"<(?:script|img|iframe|source)[^>]* src=\"?https?://|<link[^>]*stylesheet[^>]*https?://|@import")


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    pytest.importorskip("mkdocs")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    done = subprocess.run(command, cwd=ROOT, env=environment(), capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_pages_fetch_nothing_from_elsewhere(site):
    for page in [*site.rglob("*.html"), *site.rglob("*.css")]:
        assert not _FETCHED.search(page.read_text(encoding="utf-8")), page


def test_formulas_are_drawn(site):
    method = (site / "method.html").read_text(encoding="utf-8")
    assert method.count("<math") > 20
    assert 'class="arithmatex"' not in method and "<merror" not in method


def test_python_names_are_documented(site):
    import cosim

    page = unescape((site / "api.html").read_text(encoding="utf-8"))
    for name in cosim.__all__:
        assert re.search(rf'id="cosim\.[\w.]*\b{name}"', page), name


def test_every_command_and_option_is_on_its_page():
    page = commands_page(make_parser())
    for name, _, command in subcommands(make_parser()):
        assert f"## cosim {name}\n" in page
        for action in arguments(command):
            assert not action.option_strings or f"`{action.option_strings[0]}" in page


def test_the_readme_mentions_every_command():
    readme = (ROOT / "README.md").read_text(encoding="utf-8") + (ROOT / "docs/discrepancy.md").read_text(
        encoding="utf-8"
    )
    for name, *_ in subcommands(make_parser()):
        assert f"cosim {name}" in readme, name


def test_every_effect_is_on_its_page():
    page = effects_page(built_in_effects().values())
    for name, effect in built_in_effects().items():
        assert f"### {name}\n" in page
        assert all(f"`{one.name}`" in page for one in effect.parameters())


@pytest.mark.parametrize("config", [RunConfig, BehaviourConfig])
def test_every_setting_is_in_the_configuration_page(config):
    page = (ROOT / "docs/configuration.md").read_text(encoding="utf-8")
    missing = [key for key in config.model_fields if f"`{key}`" not in page]
    assert not missing


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md"])
def test_links_of_pages_outside_the_site_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)", (ROOT / page).read_text(encoding="utf-8")):
        assert "://" in target or (ROOT / target).exists(), target
