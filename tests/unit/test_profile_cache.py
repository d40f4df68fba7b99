"""Profiles in the user's cache folder: the same as their files, never out of date, and never needed."""

from __future__ import annotations

from pathlib import Path

import pytest

from care_core.files import PROFILE_FILE
from care_core.profile import cache as profile_cache
from care_core.profile import schema_file
from care_core.profile.reading import parse_schema, read_schema
from care_core.profile.schema import Schema
from care_core.profile.store import available_profiles

TEXT = (available_profiles()[0] / PROFILE_FILE).read_text(encoding="utf-8")


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "care" / "profiles"


@pytest.mark.parametrize("folder", available_profiles(), ids=lambda folder: folder.name)
def test_a_cached_profile_is_the_one_of_its_file(folder: Path, cache: Path) -> None:
    text = (folder / PROFILE_FILE).read_text(encoding="utf-8")
    schema = parse_schema(text, folder)
    profile_cache.store(text, schema)
    found = profile_cache.cached(text)
    assert found == schema


def test_the_file_is_not_checked_again_until_it_changes(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    checked = []

    def parsed(text: str, path: Path) -> Schema:
        checked.append(path)
        return original(text, path)

    original = schema_file.parsed
    monkeypatch.setattr(schema_file, "parsed", parsed)
    path = tmp_path / PROFILE_FILE
    path.write_text(TEXT, encoding="utf-8")
    assert read_schema(path) == read_schema(path)
    assert len(checked) == 1
    path.write_text(TEXT.replace("name: arducopter", "name: another", 1), encoding="utf-8")
    assert read_schema(path).name == "another"
    assert len(checked) == 2


def test_another_version_of_the_program_keeps_its_own(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    profile_cache.store(TEXT, parse_schema(TEXT, Path("p")))
    monkeypatch.setattr(profile_cache, "_program", lambda: b"changed")
    assert profile_cache.cached(TEXT) is None


@pytest.mark.parametrize("content", ["", "half", '0\n["Schema"]', "\n[]"])
def test_a_broken_entry_is_not_believed(cache: Path, content: str) -> None:
    profile_cache.store(TEXT, parse_schema(TEXT, Path("p")))
    (entry,) = cache.glob("*.json")
    whole = entry.read_text(encoding="utf-8")
    entry.write_text(content if content != "half" else whole[: len(whole) // 2], encoding="utf-8")
    assert profile_cache.cached(TEXT) is None


def test_a_folder_that_cannot_be_written_to_costs_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    path = tmp_path / PROFILE_FILE
    path.write_text(TEXT, encoding="utf-8")
    assert read_schema(path) == parse_schema(TEXT, path)


def test_the_entries_do_not_pile_up(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(profile_cache, "_MOST", 3)
    schema = parse_schema(TEXT, Path("p"))
    for i in range(5):
        profile_cache.store(f"{TEXT}# {i}\n", schema)
    assert len(list(cache.glob("*.json"))) == 3
    assert profile_cache.cached(f"{TEXT}# 4\n") == schema
