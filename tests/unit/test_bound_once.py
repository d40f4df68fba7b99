"""A name of a module is bound once: a second constant of that name is silently read in place of the first."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import care_core
import care_tui

PACKAGES = (care_core, care_tui)


def bound(statements: list[ast.stmt]) -> Iterator[str]:
    """Names that the statements of a module bind, overloads and branches aside."""
    for one in statements:
        if isinstance(one, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            if not any("overload" in ast.unparse(decorator) for decorator in one.decorator_list):
                yield one.name
        elif isinstance(one, ast.Assign):
            for target in one.targets:
                names = (node for node in ast.walk(target) if isinstance(node, ast.Name))
                yield from (name.id for name in names if isinstance(name.ctx, ast.Store))
        elif isinstance(one, ast.AnnAssign) and one.value is not None and isinstance(one.target, ast.Name):
            yield one.target.id


def bound_twice(source: str) -> list[str]:
    return sorted(name for name, count in Counter(bound(ast.parse(source).body)).items() if count > 1)


def test_what_is_bound_twice_is_found() -> None:
    assert bound_twice("A, B = 1, 2\ndef f(): A = 3\nB = 4\n") == ["B"]
    assert bound_twice("@overload\ndef f(): ...\n@overload\ndef f(): ...\ndef f(): pass\n") == []


def test_no_name_of_a_module_is_bound_twice() -> None:
    files = [file for package in PACKAGES for file in Path(package.__path__[0]).rglob("*.py")]
    assert len(files) > 500
    assert {str(file): twice for file in files if (twice := bound_twice(file.read_text(encoding="utf-8")))} == {}
