from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from care_core.errors import ProfileError
from care_core.files import PROFILE_FILE
from care_core.profile.store import Profile, available_profiles, load_profile
from care_core.records import replace
from tests.planted import SCHEMA

YAML = """\
schema_version: 1
name: tiny
version: "1"
platform: A robot
variables:
  speed: {role: option, range: [0, 1], default: 0.5}
  time: {role: objective, kind: non-functional, threshold: {op: "<=", value: 10}}
"""


@pytest.fixture
def tiny(tmp_path: Path) -> Path:
    folder = tmp_path / "tiny"
    folder.mkdir()
    (folder / PROFILE_FILE).write_text(YAML)
    return folder


def test_bundled_profiles_open_by_name() -> None:
    folders = available_profiles()
    assert folders == sorted(folders)
    for folder in folders:
        profile = load_profile(folder.name)
        assert profile.path == folder
        assert profile.schema.name == folder.name


def test_a_profile_opens_by_its_folder_and_by_its_file(tiny: Path) -> None:
    for name in (tiny, str(tiny), tiny / PROFILE_FILE):
        profile = load_profile(name)
        assert profile.path == tiny
        assert list(profile.schema.variables) == ["speed", "time"]


def test_a_misspelt_name_gets_the_nearest() -> None:
    known = available_profiles()[0].name
    with pytest.raises(ProfileError, match="no profile") as caught:
        load_profile(known[:-1])
    assert known in caught.value.hint


def test_a_name_like_no_other_gets_the_list() -> None:
    with pytest.raises(ProfileError, match="no profile 'zzzzzz'") as caught:
        load_profile("zzzzzz")
    assert all(folder.name in caught.value.hint for folder in available_profiles())


def test_an_untrained_profile_says_so_when_its_model_is_asked_for(tiny: Path) -> None:
    profile = load_profile(tiny)
    with pytest.raises(ProfileError, match="no readable model") as caught:
        _ = profile.model
    assert "care train" in caught.value.hint


def test_a_model_of_other_variables_is_refused(planted: Profile) -> None:
    with pytest.raises(ProfileError, match="other variables") as caught:
        _ = Profile(planted.path, replace(SCHEMA, digest="e" * 64)).model
    assert "care train" in caught.value.hint


def test_an_edit_of_the_variables_makes_the_model_stale(planted: Profile, tiny: Path) -> None:
    for name in ("model.json", "mechanisms.npz"):
        shutil.copy(planted.path / name, tiny)
    text = (tiny / "model.json").read_text()
    before = load_profile(tiny)
    (tiny / "model.json").write_text(text.replace(SCHEMA.digest, before.schema.digest))
    assert load_profile(tiny).model.training.runs == 250
    (tiny / PROFILE_FILE).write_text(YAML.replace("range: [0, 1]", "range: [0, 2]"))
    with pytest.raises(ProfileError, match="other variables"):
        _ = load_profile(tiny).model


def test_the_model_is_read_once(planted: Profile) -> None:
    assert planted.model is planted.model
