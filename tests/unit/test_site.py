"""The site file: whose limits win, and what is said of one that is wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from care_core.diagnose.judging import judge
from care_core.errors import ConfigError
from care_core.profile.schema import Schema
from care_core.profile.site import load_site, site_path
from care_core.profile.store import Profile
from care_core.records import replace
from care_core.run import Unavailable
from care_core.variables import Role, Threshold, Variable
from tests.planted import SCHEMA, planted_run, with_variable

ASKED = with_variable(SCHEMA, Variable("length", Role.CONTEXT, about="mission"))


def limited(text: str, folder: Path, schema: Schema = ASKED) -> Schema:
    file = folder / "ours.yaml"
    file.write_text(f"schema: care.site/1\nlimits:\n  {schema.name}:\n    {text}\n", encoding="utf-8")
    site = load_site(file)
    assert site is not None
    return site.applied(schema)


def test_the_operators_word_wins_over_the_site_and_the_site_over_the_profile(planted: Profile, tmp_path: Path) -> None:
    schema = limited('time: {op: "<=", value: 77}', tmp_path)
    ours = judge(planted_run(), schema, planted.model).results[1]
    assert (ours.threshold, ours.wanted) == (
        Threshold("<=", 77, source="ours.yaml"),
        "<= 77 s (limit of ours.yaml)",
    )
    named = judge(planted_run(), schema, planted.model, {"time": 90.0}).results[1]
    assert (named.threshold, named.wanted) == (Threshold("<=", 90), "<= 90 s")
    profiles = judge(planted_run(), SCHEMA, planted.model).results[1]
    assert profiles.threshold == SCHEMA.variables["time"].threshold


def test_a_ratio_of_the_site_is_one_to_what_the_reference_needs(planted: Profile, tmp_path: Path) -> None:
    schema = limited('time: {op: "<=", ratio: 1.1, at_least: 1}', tmp_path)
    time = judge(planted_run(), schema, planted.model).results[1]
    assert time.need is not None
    assert time.threshold == Threshold("<=", float(f"{1.1 * time.need.value:.4g}"))
    assert time.wanted.endswith("needs for this mission; limit of ours.yaml)")


def test_a_value_holds_for_its_own_mission_alone(planted: Profile, tmp_path: Path) -> None:
    schema = limited('time: {op: "<=", value: 77, mission: {length: 100}}', tmp_path)
    run = planted_run()
    assert judge(replace(run, context={"length": 99.0}), schema, planted.model).results[1].status != "not_evaluated"
    other = judge(replace(run, context={"length": 400.0}), schema, planted.model)
    assert other.results[1].status == "not_evaluated"
    value = other.run.objectives["time"]
    assert isinstance(value, Unavailable)
    assert "length 100" in value.reason


def test_limits_of_another_profile_change_nothing(tmp_path: Path) -> None:
    file = tmp_path / "site.yaml"
    file.write_text('schema: care.site/1\nlimits: {somebody: {time: {op: "<=", value: 1}}}\n', encoding="utf-8")
    site = load_site(file)
    assert site is not None
    assert site.applied(SCHEMA) is SCHEMA


def test_the_users_own_site_file_is_found(tmp_path: Path) -> None:
    assert load_site() is None
    site_path().parent.mkdir(parents=True)
    site_path().write_text("schema: care.site/1\nlimits: {}\n", encoding="utf-8")
    found = load_site()
    assert found is not None
    assert found.path == site_path()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("limits: [", "no YAML"),
        ("- 1", "no site file"),
        ("schema: care.site/2\nlimits: {}", "no site file"),
        ("schema: care.site/1\nlimits: {p: {time: {op: '<=', valeu: 3}}}", "valeu"),
        ("schema: care.site/1\nlimits: {p: {time: {op: '<=', value: .nan}}}", "value"),
        ("schema: care.site/1\nlimits: {p: {time: {op: '<=', ratio: 1.1, mission: {length: 3}}}}", "mission"),
        ("schema: care.site/1\nlimits: {p: {time: {op: '<=', ratio: 1.1, value: 3}}}", "'ratio'"),
    ],
)
def test_a_wrong_site_file_is_named_with_what_is_wrong(text: str, said: str, tmp_path: Path) -> None:
    file = tmp_path / "site.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=said) as raised:
        load_site(file)
    assert raised.value.where == str(file)


def test_what_the_profile_does_not_have_is_refused_with_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="'time'"):
        limited('tiem: {op: "<=", value: 3}', tmp_path)
    with pytest.raises(ConfigError, match="'success' cannot be limited"):
        limited('success: {op: ">=", value: 0}', tmp_path)
    with pytest.raises(ConfigError, match="'length'"):
        limited('time: {op: "<=", value: 3, mission: {lenght: 3}}', tmp_path)
    with pytest.raises(ConfigError, match="Cannot read"):
        load_site(tmp_path / "none.yaml")
