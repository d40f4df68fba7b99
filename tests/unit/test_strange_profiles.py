"""Profiles from strangers: names that are names, no folder that nobody named, and whose a profile is."""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path

import pytest

from care_core.configs.changes import apply_commands, unified_diff
from care_core.configs.formats import format_for
from care_core.ecosystems.ardupilot.dialect import ARDUPILOT_PARAM
from care_core.ecosystems.ros.dialect import ROS1_YAML, ROS2_YAML
from care_core.errors import ProfileError
from care_core.files import PROFILE_FILE, bundled, own_profiles
from care_core.profile.reading import parse_schema
from care_core.profile.store import installed_profile, load_profile
from care_core.records import replace
from care_core.run import Evidence
from care_core.variables import Change, Role, Variable
from tests.conftest import Care
from tests.planted import planted_run

SAMPLE = bundled("samples", "arducopter_failed.BIN")
PROFILE = """
schema_version: 1
name: {name}
version: '1'
platform: {platform}
variables:
  {variable}:
    role: option
    unit: {unit}
    parameter: {parameter}
"""
SOUND = {"name": "a", "platform": "b", "variable": "x", "unit": "m", "parameter": "X"}


def parse(**keys: str) -> None:
    parse_schema(PROFILE.format(**{**SOUND, **keys}), Path("p.yaml"))


@pytest.mark.parametrize(
    "name",
    ["X 1; arm throttle force 40", "Y 1\nreboot", "$(touch /tmp/x)", "`id`", "A|B", "A&B", "A>B", "A*", "A:B", "A: 1",
     "A#", "A,1", "{A}", "[A]", "A'B", 'A"B', "A\\B", "A\tB", "\x1b[2J", "-rf", "A\u202eB", "\u0410\u0412", "", " A",
     "A=1", "!A", "%A", "@A", "A?"],
    ids=ascii,
)  # fmt: skip
def test_a_parameter_is_called_nothing_that_a_shell_or_a_file_reads_otherwise(name: str) -> None:
    for written in (json.dumps(name), json.dumps(["X", name])):
        with pytest.raises(ProfileError, match=r"variables\.x\.parameter|steers a terminal") as caught:
            parse(parameter=written)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "name", ["LAND_SPEED", "/move_base/DWA/max_vel", "/a/b.c.d-e", "~local/x", "/n.qos_overrides./tf.publisher.depth"]
)
def test_what_robots_call_parameters_is_accepted(name: str) -> None:
    parse(parameter=json.dumps(name))


@pytest.mark.parametrize("name", ["../../evil", "a/b", "", ".hidden", "a\nb", "a;b", "$HOME"], ids=ascii)
def test_a_profile_and_a_variable_are_called_by_a_name(name: str) -> None:
    with pytest.raises(ProfileError, match=r"name|steers"):
        parse(name=json.dumps(name))
    with pytest.raises(ProfileError, match=r"variables|steers"):
        parse(variable=json.dumps(name))


@pytest.mark.parametrize("key", ["unit", "platform"])
def test_no_text_of_a_profile_steers_a_terminal(key: str) -> None:
    with pytest.raises(ProfileError, match="steers a terminal"):
        parse(**{key: '"\\e]52;c;AAAA\\a"'})


def test_the_attack_on_the_bundled_profile_is_refused(care: Care, tmp_path: Path) -> None:
    evil = tmp_path / "evil"
    shutil.copytree(bundled("profiles", "arducopter"), evil)
    path = evil / PROFILE_FILE
    text = path.read_text(encoding="utf-8")
    assert "    parameter: LAND_SPEED\n" in text
    bad = '    parameter: [LAND_SPEED, "X 1; arm throttle force 40", "$(touch /tmp/x)"]\n'
    path.write_text(text.replace("    parameter: LAND_SPEED\n", bad), encoding="utf-8")
    code, out, err = care("triage", SAMPLE, "--profile", evil)
    assert (code, out) == (2, "")
    assert "variables.LAND_SPEED.parameter" in err


@pytest.mark.parametrize("dialect", [ARDUPILOT_PARAM, ROS1_YAML, ROS2_YAML], ids=lambda one: one.name)
@pytest.mark.parametrize("reboot", [False, True])
def test_commands_are_quoted_even_if_a_name_got_through(dialect: object, reboot: bool) -> None:
    import shlex

    name = "/n ode.x; reboot\nparam set ARMING_CHECK 0 $(id)"
    option = Variable("x", Role.OPTION, parameters=(name,), reboot_required=reboot)
    lines = apply_commands([Change(option, 1.0, 2.0)], dialect)  # type: ignore[arg-type]
    assert not [line for line in lines if "\n" in line]
    for line in lines:
        words = shlex.split(line, comments=True)
        assert "$(id)" not in words
        assert words in ([], ["reboot"]) or words[0] in ("param", "rosparam", "rosrun", "ros2")
    run = planted_run()
    diff = unified_diff(replace(run, config={"x": 1.0}), [Change(option, 1.0, 2.0)])
    assert [line[0] for line in diff.splitlines()] == ["-", "+", "@", "-", "+"]
    assert format_for(run.log.format, run.settings) is ARDUPILOT_PARAM


def test_a_folder_is_no_profile_unless_somebody_named_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder that is called as an installed profile is takes not its place."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(bundled("profiles", "arducopter"), tmp_path / "arducopter")
    shutil.copytree(bundled("profiles", "arducopter"), tmp_path / "evil")
    assert load_profile("arducopter").path == bundled("profiles", "arducopter")
    assert load_profile("./arducopter").path == Path("arducopter")
    assert load_profile("./evil").path == Path("evil")
    for name in ("evil", "./evil", str(tmp_path / "evil"), "../evil", "./arducopter"):
        with pytest.raises(ProfileError, match="no profile"):
            installed_profile(name)


@pytest.mark.long
def test_a_profile_from_elsewhere_is_said_to_be_one(care: Care, tmp_path: Path) -> None:
    copy = tmp_path / "elsewhere/arducopter"
    shutil.copytree(bundled("profiles", "arducopter"), copy)
    for format in ("--json", "--yaml", "--markdown", ""):
        _, out, _ = care("triage", SAMPLE, "--profile", copy, *([format] if format else []))
        assert "not CaRE's own" in " ".join(out.replace("&#39;", "'").split()), format
    _, out, _ = care("triage", SAMPLE, "--profile", copy)
    assert f"Profilearducopter(from{copy},notCaRE'sown)" in "".join(out.split())
    _, out, _ = care("triage", SAMPLE, "--profile", copy, "--markdown", "--anonymous")
    assert str(tmp_path) not in out
    own = own_profiles() / "mine"
    shutil.copytree(copy, own)
    for name in ("arducopter", "mine"):
        _, out, _ = care("triage", SAMPLE, "--profile", name)
        assert "not CaRE's own" not in out


RULE = """
evidence:
  - {{text: {text}, options: [x]}}
"""


@pytest.mark.parametrize(
    "text",
    ["(a+)+", "([a-z ]+)+#", "(a|ab)*c", "(?:a?){30}", "(?i:a*)+", "(?=a*)*", "(a*)*?", ".*.*.*x", "(x*|y)z*w*",
     "(?P<x>a)((?P=x))*"],
)  # fmt: skip
def test_a_rule_that_could_look_for_ever_is_refused(text: str) -> None:
    with pytest.raises(ProfileError, match="may take for ever"):
        parse_schema(PROFILE.format(**SOUND) + RULE.format(text=json.dumps(text)), Path("p.yaml"))


@pytest.mark.parametrize("text", ["GPS .*(HDOP|not healthy)|Need 3D Fix", "a.*b.*c", "(?:ab)+", "a?b?c?d?", "(a.*b)?"])
def test_a_rule_with_few_repetitions_is_quick_on_any_message(text: str) -> None:
    schema = parse_schema(PROFILE.format(**SOUND) + RULE.format(text=json.dumps(text)), Path("p.yaml"))
    began = time.perf_counter()
    schema.pointed(Evidence(0.0, "GPS ab" * 50_000, "refusal"), {})
    assert time.perf_counter() - began < 2.0
