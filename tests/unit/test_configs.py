"""Configuration files: what is read with file and line, what is refused, what is written for a fix."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.configs import (
    ConfigFormat,
    apply_commands,
    format_for,
    read_config,
    read_configs,
    unified_diff,
    write_params,
)
from care_core.diagnose.records import Change
from care_core.errors import ConfigError
from care_core.run import Setting
from care_core.variables import Role, Variable
from tests.made import DRIVEN, LAND_SPEED, made_diagnosis


def written(tmp_path: Path, name: str, text: str) -> Path:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_the_ways_a_parameter_file_is_written(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        "a.param",
        "# note\nA 1.5\nB,2 # why\nC\t0x10\nD, -3\nE 5 @READONLY\n1\t1\tF\t0.35\t9\n\n",
    )
    settings = read_config(path)
    assert {name: setting.value for name, setting in settings.items()} == {
        "A": 1.5,
        "B": 2.0,
        "C": 16.0,
        "D": -3.0,
        "E": 5.0,
        "F": 0.35,
    }
    assert settings["B"].source == f"{path}:3"


@pytest.mark.parametrize("line", ["A", "A x", "A 1 2", "A,0xZZ"])
def test_a_line_that_is_no_parameter_is_named(tmp_path: Path, line: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read_config(written(tmp_path, "a.parm", f"# first\n{line}\n"))
    assert caught.value.where.endswith("a.parm:2")


def test_nested_names_are_namespaces(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        "move_base.yaml",
        "controller_frequency: 5\nDWAPlannerROS:\n  sim_time: 1.7 # s\n  holonomic: false\n"
        "  name: dwa\n  plugins: [a]\n  x:\n",
    )
    settings = read_config(path)
    assert {name: setting.value for name, setting in settings.items()} == {
        "controller_frequency": 5.0,
        "DWAPlannerROS/sim_time": 1.7,
        "DWAPlannerROS/holonomic": "false",
        "DWAPlannerROS/name": "dwa",
    }
    assert settings["DWAPlannerROS/sim_time"].source == f"{path}:3"


def test_a_dump_of_dynamic_reconfigure_is_read_without_building_its_object(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        "dump.yaml",
        "!!python/object/new:dynamic_reconfigure.encoding.Config\n"
        "dictitems:\n  occdist_scale: 0.02\n  groups: !!python/object/new:dynamic_reconfigure.encoding.Config\n"
        "    dictitems: {id: 0}\nstate: []\n",
    )
    assert read_config(path)["occdist_scale"].value == 0.02


def test_a_tag_never_runs_anything(tmp_path: Path) -> None:
    path = written(tmp_path, "evil.yaml", "a: !!python/object/apply:os.system ['touch /tmp/care_evil']\nb: 1\n")
    assert list(read_config(path)) == ["b"]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("a: [1, 2", "Not valid YAML"),
        ("- a\n- b\n", "no mapping"),
        ("a: &a\n  b: *a\n", "too deeply"),
        (
            "x0: &x0 {a: 1, b: 1, c: 1}\n"
            + "".join(f"x{i}: &x{i} {{a: *x{i - 1}, b: *x{i - 1}, c: *x{i - 1}}}\n" for i in range(1, 20)),
            "more values",
        ),
    ],
)
def test_a_file_that_is_no_configuration_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(ConfigError, match=reason):
        read_config(written(tmp_path, "a.yaml", text))


def test_an_absent_or_binary_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="No such file"):
        read_config(tmp_path / "none.param")
    path = tmp_path / "binary.param"
    path.write_bytes(b"\xa3\x95\x80\xff")
    with pytest.raises(ConfigError, match="not text"):
        read_config(path)


def test_an_empty_file_holds_nothing(tmp_path: Path) -> None:
    assert read_config(written(tmp_path, "a.yaml", "")) == {}
    assert read_config(written(tmp_path, "a.param", "")) == {}


def test_the_later_file_wins(tmp_path: Path) -> None:
    first, second = written(tmp_path, "a.param", "A 1\nB 1\n"), written(tmp_path, "b.param", "A 2\n")
    merged = read_configs([first, second])
    assert (merged["A"].value, merged["B"].value) == (2.0, 1.0)


@given(
    st.dictionaries(
        st.from_regex(r"[A-Z][A-Z0-9_]{0,14}", fullmatch=True),
        st.floats(-1e6, 1e6, width=32).map(lambda value: float(f"{value:.7g}")),
        max_size=20,
    )
)
def test_written_parameters_read_back(values: dict[str, float]) -> None:
    from care_core.configs import ardupilot_param

    settings = {name: Setting(name, value, "made") for name, value in values.items()}
    text = write_params(settings, ConfigFormat.ARDUPILOT_PARAM)
    assert {name: s.value for name, s in ardupilot_param.read(text, Path("a")).items()} == values


def test_written_ros_parameters_read_back(tmp_path: Path) -> None:
    values: dict[str, float | str] = {"/a/b/x": 1.5, "/a/b/on": "true", "/a/n": 3.0, "/a/name": "dwa"}
    settings = {name: Setting(name, value, "made") for name, value in values.items()}
    path = written(tmp_path, "a.yaml", write_params(settings, ConfigFormat.ROS1_YAML))
    assert {f"/{name}": s.value for name, s in read_config(path).items()} == values


def test_the_diff_shows_only_what_changes() -> None:
    diagnosis = made_diagnosis()
    assert diagnosis.fix is not None
    lines = unified_diff(diagnosis.run, diagnosis.fix).splitlines()
    assert lines[:2] == ["--- as driven", "+++ suggested"]
    assert lines[3:] == ["-LAND_SPEED,16", "+LAND_SPEED,50"]


def test_a_fix_that_changes_nothing_has_no_diff() -> None:
    diagnosis = made_diagnosis()
    assert diagnosis.fix is not None
    fix = replace(diagnosis.fix, changes=(Change(LAND_SPEED, DRIVEN, DRIVEN),))
    assert unified_diff(diagnosis.run, fix) == ""


def test_commands_of_each_ecosystem() -> None:
    reboots = replace(LAND_SPEED, reboot_required=True)
    assert format_for("dataflash-bin") is ConfigFormat.ARDUPILOT_PARAM
    assert apply_commands([Change(reboots, 16.0, 50.0)], ConfigFormat.ARDUPILOT_PARAM) == [
        "param set LAND_SPEED 50",
        "reboot",
    ]
    occdist = Variable("occdist_scale", Role.OPTION, parameters=("/move_base/DWAPlannerROS/occdist_scale",))
    samples = Variable("samples", Role.OPTION, "int", parameters=("/move_base/a/n", "/move_base/b/n"))
    assert apply_commands([Change(occdist, 0.1, 1.0), Change(samples, 3.0, 6.0)], ConfigFormat.ROS1_YAML) == [
        "rosrun dynamic_reconfigure dynparam set /move_base/DWAPlannerROS occdist_scale 1.0",
        "rosrun dynamic_reconfigure dynparam set /move_base/a n 6",
        "rosrun dynamic_reconfigure dynparam set /move_base/b n 6",
    ]


def test_every_recorded_configuration_is_read(recorded: Path) -> None:
    folder = recorded / "logs" / "configs"
    files = [path for kind in ("ardupilot_param", "ros1_nav") for path in (folder / kind).rglob("*") if path.is_file()]
    assert files
    assert all(read_config(path) for path in files)
