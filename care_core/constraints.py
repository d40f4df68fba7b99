"""Constraints: inequalities between options that no mission of a campaign and no suggestion breaks, written as an
operator writes them and never executed.

`max_vel_x <= 0.8`, `0.2 <= inflation_radius`, `max_vel_x * sim_time <= inflation_radius + 1.5`: names of options,
numbers, `+ - * /`, brackets, and `< <= > >=`. Whatever else a text holds is refused.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Iterator, Mapping
from functools import cache

from care_core.errors import UsageError, nearest
from care_core.records import Record

_ARITHMETIC: Mapping[type, Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_COMPARISONS: Mapping[type, Callable[[float, float], bool]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_LONGEST = 500


class Constraint(Record):
    """One inequality; `holds` says whether a configuration keeps it."""

    text: str

    def holds(self, config: Mapping[str, float]) -> bool:
        """Whether it is kept; one that cannot be computed (a division by zero) is not."""
        tree = _tree(self.text)
        try:
            sides = [_value(side, config) for side in (tree.left, *tree.comparators)]
        except (ZeroDivisionError, OverflowError):
            return False
        if not all(map(math.isfinite, sides)):
            return False
        pairs = zip(tree.ops, sides, sides[1:], strict=False)
        return all(_COMPARISONS[type(op)](a, b) for op, a, b in pairs)

    @property
    def options(self) -> frozenset[str]:
        """The options that it names."""
        return frozenset(node.id for node in ast.walk(_tree(self.text)) if isinstance(node, ast.Name))


def parse_constraint(text: str, options: Mapping[str, object]) -> Constraint:
    """A limit from its text.

    Raises:
        UsageError: it is not an inequality, or names what is not an option.
    """
    constraint = Constraint(text.strip())
    for name in sorted(constraint.options):
        if name not in options:
            raise UsageError(
                f"'{constraint.text}' names '{name}', which is not a parameter that has a value here.",
                hint=nearest(name, options),
                where="limits",
            )
    return constraint


@cache
def _tree(text: str) -> ast.Compare:
    """The inequality that a text is. Raises UsageError."""
    hint = "Write an inequality of options and numbers, such as 'max_vel_x * sim_time <= 1.5'."
    try:
        tree = ast.parse(text, mode="eval").body if len(text) <= _LONGEST else None
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        tree = None
    if not isinstance(tree, ast.Compare) or not all(map(_is_allowed, _parts(tree))):
        raise UsageError(f"'{text[:80]}' is not a limit.", hint=hint, where="limits")
    return tree


def _parts(tree: ast.Compare) -> Iterator[ast.AST]:
    return (node for node in ast.walk(tree) if node is not tree)


def _is_allowed(node: ast.AST) -> bool:
    if isinstance(node, ast.Constant):
        return type(node.value) in (int, float)
    return isinstance(
        node, (ast.Name, ast.Load, ast.BinOp, ast.UnaryOp, ast.USub, ast.UAdd, *_ARITHMETIC, *_COMPARISONS)
    )


def _value(node: ast.expr, config: Mapping[str, float]) -> float:
    if isinstance(node, ast.Name):
        return float(config[node.id])
    if isinstance(node, ast.Constant):
        return float(node.value)  # type: ignore[arg-type]  # `_is_allowed` let numbers through alone
    if isinstance(node, ast.UnaryOp):
        value = _value(node.operand, config)
        return -value if isinstance(node.op, ast.USub) else value
    if isinstance(node, ast.BinOp):
        return _ARITHMETIC[type(node.op)](_value(node.left, config), _value(node.right, config))
    raise ValueError(f"{type(node).__name__} does not belong in a limit")
