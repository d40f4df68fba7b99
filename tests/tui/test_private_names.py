"""The app uses what Textual documents: none of its private modules, methods or attributes."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from importlib import import_module
from inspect import getmembers, isclass
from pathlib import Path

import pytest
from textual.dom import DOMNode
from textual.message_pump import MessagePump
from textual.widget import Widget

ROOT = Path(__file__).parents[2]
FILES = sorted(
    path
    for path in (ROOT / "care_tui").rglob("*.py")
    if re.search(r"(from|import) textual\b(?!_)", path.read_text(encoding="utf-8"))
)


def classes() -> Iterator[type[MessagePump]]:
    """Every screen, page and widget of the app, and the app."""
    for file in FILES:
        module = import_module(".".join(file.relative_to(ROOT).with_suffix("").parts))
        for _, found in getmembers(module, isclass):
            if issubclass(found, MessagePump) and found.__module__ == module.__name__:
                yield found


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_no_private_module_is_imported_and_nothing_private_of_others_is_touched(file: Path) -> None:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith(("textual", "rich")):
            assert not any(part.startswith("_") for part in node.module.split(".")), node.module
        if isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.startswith("__"):
            owner = node.value
            assert isinstance(owner, ast.Name), f"line {node.lineno}: {node.attr}"
            assert owner.id in ("self", "cls", "os", "sys", "made"), f"line {node.lineno}: {owner.id}.{node.attr}"


@pytest.mark.parametrize("kind", classes(), ids=lambda kind: kind.__name__)
def test_no_private_name_of_textual_is_overridden_or_read(kind: type[MessagePump]) -> None:
    theirs = {
        name
        for base in kind.__mro__
        if base.__module__.startswith("textual")
        for name in (*vars(base), *_assigned(base))
        if name.startswith("_") and not name.startswith("__")
    }
    ours = {name for name in vars(kind) if name.startswith("_") and not name.startswith("__")}
    generated = {
        name
        for name in ours
        if name.startswith(("_inherit", "_css", "_merged", "_computes", "_decorated", "_default_"))
    }
    assert (ours - generated) & theirs <= {"_reactives"}, "overridden"
    read = {name for name in _read_of_self(kind) if name in theirs}
    assert not read, "read"


def _assigned(base: type) -> set[str]:
    """Attributes that methods of a class of Textual set on `self`."""
    return set(_of_self(_definition(base), ast.Store))


def _read_of_self(kind: type) -> set[str]:
    return set(_of_self(_definition(kind), ast.Load)) | set(_of_self(_definition(kind), ast.Store))


def _definition(kind: type) -> ast.AST:
    """The source of a class; nothing where it is made at run time."""
    tree = _tree(Path(import_module(kind.__module__).__file__ or ""))
    found = (node for node in ast.walk(tree) if isinstance(node, ast.ClassDef) and node.name == kind.__name__)
    return next(found, ast.Module([], []))


def _of_self(found: ast.AST, kind: type[ast.expr_context]) -> Iterator[str]:
    for node in ast.walk(found):
        if not isinstance(node, ast.Attribute) or not isinstance(node.value, ast.Name) or node.value.id != "self":
            continue
        if node.attr.startswith("_") and not node.attr.startswith("__") and isinstance(node.ctx, kind):
            yield node.attr


_TREES: dict[Path, ast.Module] = {}


def _tree(file: Path) -> ast.Module:
    if file not in _TREES:
        _TREES[file] = ast.parse(file.read_text(encoding="utf-8"))
    return _TREES[file]


def test_there_are_classes_to_look_at() -> None:
    assert len(list(classes())) > 25
    assert all(issubclass(kind, MessagePump) for kind in (Widget, DOMNode))
