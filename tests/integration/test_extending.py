"""The examples of docs/extending.md work as they stand: their modules, with their rows, pass their tests."""

from __future__ import annotations

import importlib
import inspect
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest

from care_core.ecosystems import px4, registry
from care_core.ecosystems.measures import EXTRACTORS
from care_core.ecosystems.px4 import checks
from care_core.logs import formats
from care_core.report import formats as report_formats

PAGE = Path(__file__).parents[2] / "docs" / "extending.md"
_BLOCK = re.compile(r"```python\n# (?P<path>[\w/]+)\.py\n(?P<code>.*?)```", re.DOTALL)
Row = Callable[[pytest.MonkeyPatch, ModuleType], None]


def _add_check(patch: pytest.MonkeyPatch, module: ModuleType) -> None:
    patch.setattr(checks, "CHECKS", (*checks.CHECKS, module.CHECK))


def _add_measures(patch: pytest.MonkeyPatch, module: ModuleType) -> None:
    patch.setattr(px4.Px4, "measures", (*px4.Px4.measures, module.__name__))


def _add_log_format(patch: pytest.MonkeyPatch, module: ModuleType) -> None:
    patch.setattr(formats, "FORMATS", (*formats.FORMATS, module.JSON_LOG))


def _add_report_format(patch: pytest.MonkeyPatch, module: ModuleType) -> None:
    patch.setitem(report_formats.FORMATS, "csv", report_formats.Format("csv", "CSV", (".csv",), module.to_csv))


def _add_ecosystem(patch: pytest.MonkeyPatch, module: ModuleType) -> None:
    patch.setattr(formats, "FORMATS", (*formats.FORMATS, sys.modules["care_core.logs.pump_log"].PUMP_LOG))
    patch.setattr(registry, "_PACKAGES", (*registry._PACKAGES, module.__name__))


ROWS: dict[str, Row] = {
    "A check": _add_check,
    "A measure": _add_measures,
    "A log format": _add_log_format,
    "A report format": _add_report_format,
    "An ecosystem": _add_ecosystem,
}


def _sections() -> dict[str, str]:
    parts = re.split(r"^## (.*)$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    return dict(zip(parts[::2], parts[1::2], strict=True))


def _module(name: str, code: str, patch: pytest.MonkeyPatch) -> ModuleType:
    """A module of the page, importable under the name that its file would give it."""
    module = ModuleType(name)
    patch.setitem(sys.modules, name, module)
    package, _, last = name.rpartition(".")
    patch.setattr(importlib.import_module(package), last, module, raising=False)
    exec(compile(code, name, "exec"), module.__dict__)
    return module


def test_every_section_is_tried() -> None:
    assert _sections().keys() == ROWS.keys()


@pytest.fixture(autouse=True)
def _registries_as_they_were() -> Iterator[None]:
    registry.register_measures()
    known = dict(EXTRACTORS)
    registry.ecosystems.cache_clear()
    yield
    registry.ecosystems.cache_clear()
    EXTRACTORS.clear()
    EXTRACTORS.update(known)


@pytest.mark.parametrize("section", ROWS)
def test_the_example_works(section: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    *blocks, test = _BLOCK.finditer(_sections()[section])
    for block in blocks:
        module = _module(block["path"].replace("/", "."), block["code"], monkeypatch)
    ROWS[section](monkeypatch, module)
    tests = _module(test["path"].replace("/", "."), test["code"], monkeypatch)
    for name, function in inspect.getmembers(tests, inspect.isfunction):
        if name.startswith("test_"):
            function(*(tmp_path for _ in inspect.signature(function).parameters))
