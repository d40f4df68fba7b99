"""What is wrong with a profile is said where it is read, with the nearest name that is known."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from care_core.ecosystems.measures import points
from care_core.errors import ProfileError
from care_core.extract.read import reading_plan
from care_core.files import own_profiles
from care_core.profile.reading import parse_schema
from care_core.profile.store import available_profiles, load_profile
from tests.conftest import Care

ROOT = Path(__file__).parents[2]
SAMPLE = ROOT / "samples" / "arducopter_failed.BIN"
MISSION = "{kind: ardupilot_flight, tolerance_m: 5}"
EXTRACT = "{kind: rate_error, axis: roll, stat: mean}"


def profile(logs: str = "[dataflash-bin]", mission: str = MISSION, extract: str = EXTRACT) -> str:
    return f"""\
schema_version: 1
name: own
version: "1"
platform: a quadcopter
logs: {logs}
mission: {mission}
variables:
  LAND_SPEED: {{role: option, parameter: LAND_SPEED}}
  shake: {{role: metric, extract: {extract}}}
"""


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (profile(mission="{kind: ardupilot_flight, tolerance_mm: 5}"), "Did you mean 'tolerance_m'?"),
        (profile(mission="{kind: ardupilot_fligth}"), "Did you mean 'ardupilot_flight'?"),
        (profile(mission="{kind: ardupilot_flight, tolerance_m: near}"), "takes no 'tolerance_m: near'"),
        (profile(mission="{kind: ardupilot_flight, waypoints: [[1, 2]]}"), "list of [latitude, longitude, height"),
        (profile(extract="{kind: rate_error, statt: mean}"), "Did you mean 'stat'?"),
        (profile(extract="{kind: rate_error, axis: rol}"), "Did you mean 'roll'?"),
        (profile(extract="{kind: rate_error, axis: tilt}"), "It is: roll, pitch or yaw"),
        (profile(extract="{kind: rate_errror}"), "Did you mean 'rate_error'?"),
        (profile(extract="{kind: crash, stat: mean}"), "It takes none."),
        (profile(extract="{kind: settling_time, within_m: true}"), "takes no 'within_m: True'"),
        (profile(logs="[dataflash-txt]"), "Did you mean 'dataflash-text'?"),
    ],
    ids=range(11),
)
def test_a_slip_is_refused_with_the_nearest_known_name(text: str, says: str) -> None:
    with pytest.raises(ProfileError) as error:
        reading_plan(parse_schema(text, Path("profile.yaml")))
    assert says in str(error.value)


def test_the_profile_itself_is_sound() -> None:
    assert reading_plan(parse_schema(profile(), Path("profile.yaml")))


def install(name: str, text: str = "") -> Path:
    """A profile of the user's own: the bundled one under another name, or the text."""
    folder = own_profiles() / name
    shutil.copytree(ROOT / "profiles" / "arducopter", folder)
    yaml = folder / "profile.yaml"
    yaml.write_text(text or yaml.read_text(encoding="utf-8").replace("name: arducopter", f"name: {name}", 1))
    return folder


def test_profiles_of_the_users_own_are_found_and_chosen(care: Care) -> None:
    folder = install("aa_mine")
    assert folder in available_profiles()
    assert load_profile("aa_mine").path == folder
    listed = care("profiles", "list")
    assert "aa_mine" in listed.stdout
    answer = care("triage", str(SAMPLE), "--json", "--no-history")
    assert '"name": "aa_mine"' in answer.stdout  # it fits as well as the bundled one, and comes first by name


def test_an_own_profile_stands_for_the_bundled_one_of_its_name() -> None:
    folder = install("arducopter")
    assert load_profile("arducopter").path == folder


def test_an_unsound_profile_keeps_no_other_from_use(care: Care) -> None:
    install("aa_broken", profile(extract="{kind: rate_error, axis: rol}"))
    answer = care("triage", str(SAMPLE), "--json", "--no-history")
    assert '"name": "arducopter"' in answer.stdout
    listed = care("profiles")
    assert "arducopter" in listed.stdout
    assert "Did you mean 'roll'?" in listed.stderr
    assert care("profiles", "check", "aa_broken").code == 2


@pytest.mark.parametrize("wrong", [[[1.0]], [["a", 1.0]], [1.0, 2.0], [[1.0, 2.0], "ab"], "ab"])
def test_goals_are_points_of_numbers(wrong: object) -> None:
    assert not points("goals", 2, 3).accepts(wrong)
    assert points("goals", 2, 3).accepts([[1.0, 2.0], [1, 2, 3]])
