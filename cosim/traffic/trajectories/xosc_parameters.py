"""Parameters of OpenSCENARIO: declared in a scope, assigned by references, used as `$NAME` or `${expression}`.

ASAM OpenSCENARIO XML 1.3, 9.1 (parameters: an element sees what its own and all enclosing elements declare, the nearest
first; assignments of a catalogue reference replace the values declared by the entry) and 9.2 (expressions).
"""

from __future__ import annotations

import ast
import math
import operator
import re
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping

from cosim.traffic.trajectories.tracks import TrajectoryError

_USE = re.compile(r"\$\{([^}]*)\}|\$(\w+)")
_OPERATORS: dict[type, Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: math.fmod,
}
_CONSTANTS = {"pi": math.pi, "e": math.e}
_FUNCTIONS: dict[str, Callable[..., float]] = {
    "round": round,
    "ceil": math.ceil,
    "floor": math.floor,
    "sqrt": math.sqrt,
    "pow": math.pow,
}
_NAMES = ("name", "storyboardElementRef")
_LONGEST = 200  # characters of an expression


def resolve_parameters(source: str, element: ET.Element, outer: Mapping[str, str] | None = None) -> None:
    """Replace uses of parameters in an element and all below it, in place.

    Args:
        source: file and location, for messages.
        element: declares parameters for itself and its children.
        outer: values that enclosing elements declare, or that a reference assigns.

    Raises:
        TrajectoryError: a parameter is declared nowhere, or an expression is none.
    """
    _resolve(source, element, dict(outer or {}), frozenset())


def resolve_entry(source: str, entry: ET.Element, reference: Mapping[str, str]) -> None:
    """Resolve an entry of a catalogue: values that the reference assigns replace those declared."""
    _resolve(source, entry, dict(reference), frozenset(reference))


def _resolve(source: str, element: ET.Element, values: dict[str, str], fixed: frozenset[str]) -> None:
    declarations = element.findall("ParameterDeclarations/ParameterDeclaration")
    values = dict(values)
    for declaration in declarations:
        name = declaration.get("name", "")
        if name not in fixed:
            values[name] = _substitute(source, declaration.get("value", ""), values)
    for key, text in element.attrib.items():
        if "$" in text and not _refers(element, key):
            element.set(key, _name(source, text, values) if key in _NAMES else _substitute(source, text, values))
    for child in element:
        if child.tag != "ParameterDeclarations":
            _resolve(source, child, values, fixed)
        else:
            for declaration in child:
                declaration.set("value", values.get(declaration.get("name", ""), declaration.get("value", "")))


def _name(source: str, text: str, values: Mapping[str, str]) -> str:
    """A name with parameters; unchanged where an expression in it is not arithmetic, since it only has to be unique."""
    try:
        return _substitute(source, text, values)
    except TrajectoryError:
        return text


def _refers(element: ET.Element, key: str) -> bool:
    """Whether an attribute names a parameter of a catalogue entry, in another scope."""
    return element.tag == "ParameterAssignment" and key == "parameterRef"


def _substitute(source: str, text: str, values: Mapping[str, str]) -> str:
    def value(match: re.Match[str]) -> str:
        if match[1] is not None:
            return f"{_evaluate(source, match[1], values):.12g}"
        if match[2] not in values:
            raise TrajectoryError(
                f"{source}: ${match[2]} is not declared before its use in an element around it; declare it in "
                f"<ParameterDeclarations>, above the parameters that refer to it"
            )
        return values[match[2]]

    return _USE.sub(value, text)


def _evaluate(source: str, text: str, values: Mapping[str, str]) -> float:
    """Value of an arithmetic expression; only numbers, parameters, pi, e, + - * / % and five functions are allowed."""
    filled = _substitute(source, text, values)
    try:
        if len(filled) > _LONGEST:
            raise ValueError("it is too long")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)  # the text is a user's
            return float(_value(ast.parse(filled.strip(), mode="eval").body))
    except (SyntaxError, ValueError, TypeError, ZeroDivisionError, OverflowError, RecursionError, MemoryError) as error:
        raise TrajectoryError(
            f"{source}: ${{{text}}} is no arithmetic expression that can be evaluated ({error}); write its value"
        ) from None


def _value(node: ast.expr) -> float:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return float(node.value)
    if isinstance(node, ast.Name) and node.id in _CONSTANTS:
        return _CONSTANTS[node.id]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        return -_value(node.operand) if isinstance(node.op, ast.USub) else _value(node.operand)
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return _OPERATORS[type(node.op)](_value(node.left), _value(node.right))
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        function = _FUNCTIONS.get(node.func.id)
        if function is not None:
            return float(function(*(_value(argument) for argument in node.args)))
    raise ValueError(f"{ast.unparse(node)} is not supported")
