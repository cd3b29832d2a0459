"""Safe parsing of YAML and JSON from untrusted files: plain values only, of limited size."""

from __future__ import annotations

import json
from typing import Any

import yaml

_LARGEST_CHARS = 64 << 20
_MOST_VALUES = 1_000_000  # aliases counted as often as they are used
_DEEPEST = 100


class DocumentError(ValueError):
    """Text is no document of plain values; the message is one line."""


def parse_yaml(text: str) -> Any:
    """Value of a YAML document: strings, numbers, dates, lists and mappings only.

    Raises:
        DocumentError: not YAML, too large or deep, recursive aliases, or aliases that expand to too many values.
    """
    _check_size(text)
    try:
        loader = yaml.SafeLoader(text)
        try:
            node = loader.get_single_node()
            if node is None:
                return None
            _weigh(node, 0, {})
            return loader.construct_document(node)
        finally:
            loader.dispose()
    except RecursionError:
        raise DocumentError(f"nested deeper than {_DEEPEST} levels") from None
    except (yaml.YAMLError, ValueError, TypeError, OverflowError, AttributeError) as error:
        # Scalars that only look like dates or numbers raise whatever their types do.
        raise DocumentError(" ".join(str(error).split())) from None


def parse_json(text: str) -> Any:
    """The value of a JSON document.

    Raises:
        DocumentError: not JSON, or too large or deep.
    """
    _check_size(text)
    try:
        return json.loads(text)
    except RecursionError:
        raise DocumentError("nested too deeply") from None
    except ValueError as error:
        raise DocumentError(" ".join(str(error).split())) from None


def _check_size(text: str) -> None:
    if len(text) > _LARGEST_CHARS:
        raise DocumentError(f"larger than {_LARGEST_CHARS >> 20} MiB")


def _weigh(node: yaml.Node, depth: int, known: dict[int, int]) -> int:
    """Number of values in a node after its aliases are expanded."""
    if depth > _DEEPEST:
        raise DocumentError(f"nested deeper than {_DEEPEST} levels, or an alias holds itself")
    if id(node) not in known:
        below = []
        if isinstance(node, yaml.MappingNode):
            below = [part for pair in node.value for part in pair]
        elif isinstance(node, yaml.SequenceNode):
            below = node.value
        known[id(node)] = 1 + sum(_weigh(part, depth + 1, known) for part in below)
        if known[id(node)] > _MOST_VALUES:
            raise DocumentError(f"holds more than {_MOST_VALUES:,} values")
    return known[id(node)]
