"""Reference pages made from the code itself, so that they cannot fall behind it."""

from __future__ import annotations

import argparse
import inspect
import textwrap
from collections.abc import Container, Iterable

from sensors.effects.base import Effect, Parameter

_STAGES = {
    "beam": ("Beams", "Where beams really look and when they leave, before they are traced."),
    "echo": ("Echoes", "Which surface answers, how strongly, and whether that is noticed."),
    "point": ("Points", "What is read of a return: its range and its intensity."),
    "scan": ("Scans", "Returns that no surface gave, and returns that are removed."),
    "label": ("Labels", "What annotators write down of objects."),
}


def commands_page(parser: argparse.ArgumentParser) -> str:
    """Markdown of all commands of a parser, with their usage and options."""
    lines = [
        "# Commands",
        "",
        "Every command takes `--help` and ends with 0, or with 2 and one line that names the mistake.",
        "",
    ]
    for name, help_text, command in subcommands(parser):
        described = " ".join((command.description or help_text).split()).removeprefix(f"`cosim {name}`: ")
        usage = " ".join(command.format_usage().removeprefix("usage: ").split()).replace("[-h] ", "")
        usage = "\n    ".join(textwrap.wrap(usage, 96, break_on_hyphens=False, break_long_words=False))
        lines += [f"## cosim {name}", "", described[:1].upper() + described[1:], "", "```text", usage, "```", ""]
        lines += ["| argument | what |", "|---|---|"]
        lines += [f"| {_spelt(action)} | {_cell(_helped(command, action))} |" for action in arguments(command)]
        lines.append("")
    return "\n".join(lines)


def subcommands(parser: argparse.ArgumentParser) -> Iterable[tuple[str, str, argparse.ArgumentParser]]:
    """Name, one-line help and parser of each command."""
    for group in parser._actions:
        if isinstance(group, argparse._SubParsersAction):
            help_texts = {choice.dest: choice.help or "" for choice in group._choices_actions}
            for name, command in group.choices.items():
                yield name, help_texts.get(name, ""), command


def arguments(command: argparse.ArgumentParser) -> list[argparse.Action]:
    """Arguments of a command except `--help`."""
    return [action for action in command._actions if not isinstance(action, argparse._HelpAction)]


def effects_page(effects: Iterable[type[Effect]]) -> str:
    """Markdown of the catalogue of sensor effects."""
    lines = [
        "# Effects",
        "",
        "The physics that a [sensor file](sensors.md) may name. R is range in metres, θ the angle between beam and",
        "the surface's normal, I intensity from 0 to 1. `cosim effects NAME --out FILE.png` draws one.",
        "",
    ]
    effects = list(effects)
    names = {effect.name for effect in effects}
    for stage, (title, message) in _STAGES.items():
        lines += [f"## {title}", "", message, ""]
        for effect in effects:
            if effect.stage == stage:
                lines += _effect(effect, names)
    return "\n".join(lines)


def _effect(effect: type[Effect], known: Container[str]) -> list[str]:
    message = inspect.cleandoc(effect.__doc__ or "").split("\n\n")[0]
    lines = [f"### {effect.name}", "", " ".join(message.split()), "", "```text", effect.equation, "```", ""]
    if effect.parameters():
        lines += ["| parameter | bounds | what |", "|---|---|---|"]
        lines += [f"| `{one.name}` | {_bounds(one)} | {_cell(one.description)} |" for one in effect.parameters()]
        lines.append("")
    facts = []
    if effect.confusable_with:
        similar = [f"[`{name}`](#{name})" if name in known else f"`{name}`" for name in effect.confusable_with]
        facts.append("looks like " + ", ".join(similar))
    if effect.needs_new_rays:
        facts.append("needs new rays")
    if effect.reference:
        facts.append(f"source: {effect.reference}")
    if effect.taxonomy:
        facts.append(f"[node in LidarLimbs]({effect.taxonomy_link()})")
    report = "; ".join(facts)
    return [*lines, f"{report[:1].upper()}{report[1:]}.", ""] if facts else lines


def _bounds(one: Parameter) -> str:
    if one.choices:
        return ", ".join(f"`{word}`" for word in one.choices)
    low, high = ("" if bound is None else f"{bound:g}".replace("-", "−") for bound in (one.low, one.high))
    many = ", one a laser" if one.per_ring else ", for length, width and height" if one.per_axis else ""
    return f"{low} … {high} {one.unit}".strip() + many if low or high else f"any {one.unit}".strip() + many


def _spelt(action: argparse.Action) -> str:
    value = action.metavar if isinstance(action.metavar, str) else None
    if value is None and action.choices is not None:
        value = "|".join(map(str, action.choices))
    if not action.option_strings:
        return f"`{value or action.dest}`"
    takes = "" if action.nargs == 0 else f" {value or action.dest.upper()}"
    return f"`{action.option_strings[0]}{takes}`" + (" (required)" if action.required else "")


def _helped(command: argparse.ArgumentParser, action: argparse.Action) -> str:
    message = command._get_formatter()._expand_help(action) if action.help else ""
    plain = action.default not in (None, False, [], argparse.SUPPRESS)
    return f"{message} (default: {action.default})" if plain and "default" not in message else message


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
