"""`cosim effects`: list the catalogue of sensor effects with equations, parameters, units, bounds and references."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console

from cosim.cli.options import add_common, write_json
from cosim.drives.writer import explained


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "effects", help="list the catalogue of sensor effects", description=__doc__
    )
    parser.add_argument(
        "name", nargs="?", metavar="NAME", help="effect to describe, or my_effect.py:ClassName (default: list all)"
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE.png", help="also draw a scan without and with the effect NAME into this file"
    )
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """List all effects, or describe one."""
    from sensors.effects.registry import effect_classes, find_effect
    from sensors.errors import SensorError

    if options.name is None:
        if options.out is not None:
            raise SensorError(f"--out {options.out} needs the name of an effect: cosim effects NAME --out FILE.png")
        classes = effect_classes()
        for effect in classes.values():
            _print(f"{effect.name:24s} {effect.stage:6s} {effect.channel:19s} {effect.equation}", options)
        write_json(options.json, {name: _as_json(effect) for name, effect in classes.items()})
        return
    effect = find_effect(options.name)
    for line in _describe(effect):
        _print(line, options)
    write_json(options.json, _as_json(effect))
    if options.out is not None:
        _draw(effect, options.out)
        console.print(f"{options.out}: {effect.name} before and after")


def _draw(effect: Any, path: Path) -> None:
    from pydantic import ValidationError

    from sensors.effects.describing import picture
    from sensors.errors import SensorError
    from sensors.pattern import first_problem

    try:
        example = effect.model_validate(effect.example)
    except ValidationError as error:
        raise SensorError(
            f"effect {effect.name}: its `example` is invalid ({first_problem(error)}); correct the class attribute"
        ) from error
    with explained(path):
        path.write_bytes(picture(example))


def _describe(effect: Any) -> list[str]:
    summary = " ".join((effect.__doc__ or "").split())
    lines = [
        f"{effect.name}: {effect.stage} stage, channel {effect.channel}",
        f"  {effect.equation}",
        f"  {summary}",
    ]
    for parameter in effect.parameters():
        bounds = " or ".join(parameter.choices) or _bounds(parameter)
        unit = f" {parameter.unit}" if parameter.unit else ""
        count = ", one per laser" if parameter.per_ring else ", one value or one per axis" if parameter.per_axis else ""
        lines.append(f"  {parameter.name}: {parameter.description} [{bounds}{unit}{count}]")
    if effect.also:
        lines.append(f"  also changes: {', '.join(effect.also)}")
    lines.append(f"  can be confused with: {', '.join(effect.confusable_with) or 'no effect of the catalogue'}")
    lines.append(f"  needs new rays: {'yes' if effect.needs_new_rays else 'no'}")
    lines.append(f"  reference: {effect.reference or 'none'}")
    if effect.taxonomy:
        lines.append(f"  taxonomy: {effect.taxonomy_link()}")
    return lines


def _bounds(parameter: Any) -> str:
    """Format the bounds of a number; each may be absent."""
    if parameter.low is None:
        return "any" if parameter.high is None else f"at most {parameter.high:g}"
    return f"at least {parameter.low:g}" if parameter.high is None else f"{parameter.low:g} … {parameter.high:g}"


def _as_json(effect: Any) -> dict[str, Any]:
    return {
        "stage": effect.stage,
        "channel": effect.channel,
        "also": list(effect.also),
        "equation": effect.equation,
        "reference": effect.reference,
        "taxonomy": effect.taxonomy_link() or None,
        "confusable_with": list(effect.confusable_with),
        "needs_new_rays": effect.needs_new_rays,
        "parameters": {
            p.name: {
                "unit": p.unit,
                "low": p.low,
                "high": p.high,
                "description": p.description,
                "per_ring": p.per_ring,
                "per_axis": p.per_axis,
                "choices": list(p.choices),
            }
            for p in effect.parameters()
        },
    }


def _print(line: str, options: argparse.Namespace) -> None:
    if not options.quiet:
        print(line)
