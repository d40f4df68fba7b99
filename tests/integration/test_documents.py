"""Every command of README.md and docs/ runs as it stands and prints what stands below it, but for the digits."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import pytest

from benchmarks.tools.documents import DOCUMENTS, ROOT, played, prepare, sessions
from benchmarks.tools.tables import with_tables
from care_core.collect.campaign import _Campaign
from care_core.profile.schema_file import _Profile, _Variable
from care_tui.settings import Settings

pytestmark = pytest.mark.long

_LINK = re.compile(r"\]\((?!https?:)([^)#\s]+)")


def without_digits(text: str) -> str:
    """A text whose numbers may differ in their last digits, and with them where its lines wrap."""
    return " ".join(re.sub(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?", "0", text).split())


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_the_commands_print_what_the_document_says(document: Path, tmp_path: Path) -> None:
    prepare(tmp_path)
    for session in sessions(document.read_text(encoding="utf-8")):
        found = played(session, tmp_path)
        assert "Traceback" not in found
        assert without_digits(found) == without_digits(session.written), "make docs renews it"


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_tables_are_what_the_code_knows(document: Path) -> None:
    page = document.read_text(encoding="utf-8")
    assert with_tables(page) == page, "make docs renews it"


@pytest.mark.parametrize(
    ("page", "keys"),
    [
        ("formats.md", _Variable.model_fields),
        ("formats.md", _Profile.model_fields),
        ("new-robot.md", _Campaign.model_fields),
        ("app.md", Settings.__struct_fields__),
    ],
    ids=("variable", "profile", "campaign", "settings"),
)
def test_every_key_of_a_file_is_explained(page: str, keys: Iterable[str]) -> None:
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    assert [key for key in keys if not re.search(rf"`{key}\b|^\s*{key}:", text, re.MULTILINE)] == []


@pytest.mark.parametrize("document", [*DOCUMENTS, ROOT / "ARCHITECTURE.md"], ids=lambda path: path.name)
def test_links_lead_somewhere(document: Path) -> None:
    for target in _LINK.findall(document.read_text(encoding="utf-8")):
        assert (document.parent / target).exists(), target


def test_troubleshooting_quotes_what_is_really_said() -> None:
    code = "".join(
        path.read_text(encoding="utf-8") for room in ("care_core", "care_tui") for path in (ROOT / room).rglob("*.py")
    )
    said = re.sub(r'"\s*(?:rf|f|r)?"', "", code)
    rows = re.findall(
        r"^\| `([^`]+)`", (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert len(rows) > 20
    parts = [part.strip() for row in rows for part in re.split(r"\.\.\.|\d+", row)]
    assert not [part for part in parts if len(part) > 3 and part not in said]


def test_every_test_that_an_invariant_names_is_there() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8").partition("## Invariants")[2].partition("\n## ")[0]
    rows = [line.split("|")[1:3] for line in text.splitlines() if line.startswith("| ")][1:]
    files = {path.name: path for path in (ROOT / "tests").rglob("*.py")}
    assert len(rows) > 20
    for invariant, guard in rows:
        named = [f"{name}.py" for name in re.findall(r"(test_\w+)\.py", guard)]
        assert set(named) <= files.keys(), invariant
        assert named or re.search(r"`tests/\w+`|`lint-imports`", guard), f"nothing guards: {invariant}"
        assert all((ROOT / folder).is_dir() for folder in re.findall(r"`(tests/\w+)`", guard)), invariant
        said = "".join(files[name].read_text(encoding="utf-8") for name in named)
        for part in re.findall(r"`\.\.([\w.]+?)(?:\.\.)?`", guard):
            assert re.search(r"def test_\w*" + r"\w*".join(map(re.escape, part.split(".."))), said), part
