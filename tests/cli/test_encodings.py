"""A terminal or pipe whose encoding lacks a character gets its escape, never an error; files are UTF-8 always."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from care_core.errors import ExitCode
from care_core.files import bundled
from care_tui.console import encodable

SAMPLE = bundled("samples", "owlat_failed.bag")
ROOT = Path(__file__).parents[2]
ENCODINGS = ("ascii:strict", "cp1252")


def care(folder: Path, *words: object, **environment: str) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-m", "care_tui", *map(str, words)]
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("LC_", "LANG", "PYTHON"))}
    env = {**kept, "PYTHONPATH": str(ROOT), **environment}
    return subprocess.run(command, capture_output=True, cwd=folder, env=env, timeout=60, check=False)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "vuelo_ñ_→_日本.BIN"
    path.symlink_to(SAMPLE)
    return path


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_no_encoding_is_an_error(log: Path, tmp_path: Path, encoding: str) -> None:
    text = care(tmp_path, "inspect", log, PYTHONIOENCODING=encoding)
    assert text.returncode == ExitCode.OK, text.stderr
    assert b"\\N{RIGHTWARDS ARROW}" in text.stdout
    assert b"Traceback" not in text.stderr
    missing = care(tmp_path, "inspect", "→.BIN", PYTHONIOENCODING=encoding)
    assert missing.returncode == ExitCode.UNREADABLE
    assert b"No such file" in missing.stderr
    assert b"Traceback" not in missing.stderr


def test_a_bare_locale_is_no_error_and_files_are_utf8(log: Path, tmp_path: Path) -> None:
    out = tmp_path / "report.md"
    ended = care(
        tmp_path, "triage", log, "--no-history", "--out", out, LC_ALL="C", PYTHONCOERCECLOCALE="0", PYTHONUTF8="0"
    )
    assert ended.returncode == ExitCode.FAULT, ended.stderr
    assert "vuelo" in out.read_text(encoding="utf-8")
    assert "→" in out.read_text(encoding="utf-8")


def test_json_and_xml_stay_what_they_are() -> None:
    told = {"log": "ñ → 日本 𝄞", "broken": "\udc80"}
    text = json.dumps(told, ensure_ascii=False)
    for encoding in ("ascii", "latin-1", "cp1252"):
        assert json.loads(encodable(text, encoding)) == told
        encodable(text, encoding).encode(encoding)
        assert ElementTree.fromstring(encodable("<a>ñ → 日本</a>", encoding)).text == "ñ → 日本"
    assert encodable("ñ → 日本", "utf-8") == "ñ → 日本"
    assert encodable("a → b", "cp1252") == "a \\N{RIGHTWARDS ARROW} b"
    assert encodable("50 °C", "cp1252") == "50 °C"
    assert encodable("\udc80", "ascii") == "\\udc80"
