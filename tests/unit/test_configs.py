"""Configuration files: what is read with file and line, what is refused, what is written for a fix."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from care_core.configs.changes import apply_commands, unified_diff
from care_core.configs.formats import format_for, write_params
from care_core.configs.loading import guesses, read_config, read_configs, resolve
from care_core.ecosystems.ardupilot.dialect import ARDUPILOT_PARAM
from care_core.ecosystems.dialect import Dialect
from care_core.ecosystems.px4.dialect import QGC_PARAMS
from care_core.ecosystems.ros.dialect import ROS1_YAML, ROS2_YAML
from care_core.errors import ConfigError
from care_core.records import replace
from care_core.run import Setting
from care_core.variables import Change, Role, Variable
from tests.made import DRIVEN, LAND_SPEED, made_diagnosis
from tests.whole import examples


def written(tmp_path: Path, name: str, text: str) -> Path:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_the_ways_a_parameter_file_is_written(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        "a.param",
        "# note\nA 1.5\nB,2 # why\nC\t0x10\nD, -3\nE 5 @READONLY\nF , 0.35\n\n",
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
        "DWAPlannerROS/plugins": "[a]",
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
        ("a: &a\n  b: *a\n", "an alias stands inside"),
        (
            "x0: &x0 {a: 1, b: 1, c: 1}\n"
            + "".join(f"x{i}: &x{i} {{a: *x{i - 1}, b: *x{i - 1}, c: *x{i - 1}}}\n" for i in range(1, 20)),
            "more than 200000 values",
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
    third = written(tmp_path, "c.params", f"{QGC}1\t1\tB\t7\t6\n")
    assert values(resolve(read_configs([first, second]), ["A", "B", "C"])) == {"A": 2.0, "B": 1.0}
    assert values(resolve(read_configs([first, second, third]), ["A", "B"])) == {"A": 2.0, "B": 7}


QGC = "# Vehicle-Id Component-Id Name Value Type\n"
COMMON = "update_frequency: 4.0\ninflation: {inflation_radius: 1.0}\n"
NODE = "controller_server:\n  ros__parameters:\n    FollowPath: {max_vel_x: 0.5}\n"


def values(settings: Mapping[str, Setting]) -> dict[str, float | str]:
    return {name: setting.value for name, setting in settings.items()}


@pytest.mark.parametrize(
    ("name", "text", "format"),
    [
        ("a.yaml", "# c\n1\t1\tA\t0.5\t9\n", QGC_PARAMS),
        ("a.params", QGC, QGC_PARAMS),
        ("a.params", "A,1.0\n", ARDUPILOT_PARAM),
        ("a.yaml", "A 1.0 # x: y\n", ARDUPILOT_PARAM),
        ("a.txt", "A\t0x10\n", ARDUPILOT_PARAM),
        ("a.param", COMMON, ROS1_YAML),
        ("a", "---\nA: 1\n", ROS1_YAML),
        (
            "dump",
            "!!python/object/new:dynamic_reconfigure.encoding.Config\ndictitems: {A: 1}\n",
            ROS1_YAML,
        ),
        ("a.txt", NODE, ROS2_YAML),
        ("a.yaml", "{/**: {'ros__parameters': {a: 1}}}", ROS2_YAML),
        ("a.yaml", "", ROS1_YAML),
    ],
)
def test_formats_are_told_apart_by_content(tmp_path: Path, name: str, text: str, format: Dialect) -> None:
    (file,) = read_configs([written(tmp_path, name, text)])
    assert file.format is format


def test_one_ros_1_file_in_several_namespaces(tmp_path: Path) -> None:
    path = written(tmp_path, "common.yaml", COMMON)
    local = written(tmp_path, "local.yaml", "local_costmap: {update_frequency: 7.0}\n")
    wanted = [f"/move_base/{one}_costmap/update_frequency" for one in ("global", "local")]
    files = read_configs([f"global_costmap={path}", f"/local_costmap/={path}", local])
    assert list(files[0].settings) == ["global_costmap/update_frequency", "global_costmap/inflation/inflation_radius"]
    assert values(resolve(files, wanted)) == dict(zip(wanted, (4.0, 7.0), strict=True))
    assert guesses(files, resolve(files, wanted)) == {}


def test_a_bare_ros_1_name_is_a_guess_that_loses_and_is_told(tmp_path: Path) -> None:
    path = written(tmp_path, "common.yaml", COMMON)
    local = written(tmp_path, "local.yaml", "local_costmap: {update_frequency: 7.0}\n")
    wanted = ["/move_base/global_costmap/update_frequency", "/move_base/local_costmap/update_frequency"]
    files = read_configs([local, path])
    found = resolve(files, [*wanted, "/move_base/local_costmap/inflation/inflation_radius"])
    assert list(values(found).values()) == [4.0, 7.0, 1.0]
    assert guesses(files, found) == {str(path): wanted[:1]}


def test_the_later_ros_1_file_wins_however_much_of_the_path_it_names(tmp_path: Path) -> None:
    whole = written(tmp_path, "a.yaml", "move_base: {DWAPlannerROS: {sim_time: 1.0}}\n")
    part = written(tmp_path, "b.yaml", "DWAPlannerROS: {sim_time: 2.0}\n")
    wanted = "/move_base/DWAPlannerROS/sim_time"
    assert values(resolve(read_configs([whole, part]), [wanted])) == {wanted: 2.0}
    assert values(resolve(read_configs([part, whole]), [wanted])) == {wanted: 1.0}


MAX_VEL = "/controller_server.FollowPath.max_vel_x"


@pytest.mark.parametrize(
    "node",
    ["controller_server", "/controller_server", "/**", "/*", "/**/controller_server", "/**/*"],
)
def test_ros_2_nodes_and_wildcards(tmp_path: Path, node: str) -> None:
    text = NODE.replace("controller_server", f'"{node}"')
    files = read_configs([written(tmp_path, "a.yaml", text)])
    assert values(resolve(files, [MAX_VEL, "/a/b.FollowPath.max_vel_x"]))[MAX_VEL] == 0.5
    deep = resolve(files, ["/local_costmap/controller_server.FollowPath.max_vel_x"])
    assert bool(deep) == node.startswith("/**")


def test_nested_and_joined_node_names_and_dotted_parameters_are_the_same(tmp_path: Path) -> None:
    texts = (
        "local_costmap:\n  local_costmap:\n    ros__parameters:\n      inflation_layer.inflation_radius: 0.7\n",
        "/local_costmap/local_costmap:\n  ros__parameters:\n    inflation_layer: {inflation_radius: 0.7}\n",
    )
    for text in texts:
        assert values(read_config(written(tmp_path, "a.yaml", text))) == {
            "/local_costmap/local_costmap.inflation_layer.inflation_radius": 0.7
        }
    spaced = read_config(written(tmp_path, "a.yaml", NODE), "robot1")
    assert list(spaced) == ["/robot1/controller_server.FollowPath.max_vel_x"]


def test_a_pattern_of_many_stars_takes_no_time(tmp_path: Path) -> None:
    """It was a regular expression that tried every way to share a name among its stars."""
    file = tmp_path / "params.yaml"
    file.write_text(f"{'/**' * 30}/b: {{ros__parameters: {{x: 1}}}}\n{'/**/a' * 30}: {{ros__parameters: {{y: 2}}}}\n")
    deep = "/a" * 100
    found = resolve(read_configs([file]), [f"{deep}.x", f"{deep}/b.x", f"{deep}.y", "/a.y"])
    assert set(found) == {f"{deep}/b.x", f"{deep}.y"}


def test_of_ros_2_nodes_that_fit_the_one_named_last_counts(tmp_path: Path) -> None:
    every = "/**: {ros__parameters: {FollowPath: {max_vel_x: 0.9}}}\n"
    first, second = written(tmp_path, "a.yaml", every + NODE), written(tmp_path, "b.yaml", NODE + every)
    third = written(tmp_path, "c.yaml", every.replace("0.9", "0.3"))
    assert values(resolve(read_configs([first]), [MAX_VEL])) == {MAX_VEL: 0.5}
    assert values(resolve(read_configs([second]), [MAX_VEL])) == {MAX_VEL: 0.9}
    assert values(resolve(read_configs([second, third]), [MAX_VEL])) == {MAX_VEL: 0.3}
    assert values(resolve(read_configs([first, third]), [MAX_VEL])) == {MAX_VEL: 0.5}


def test_a_ros_2_value_without_its_node_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="is not under 'ros__parameters'") as caught:
        read_config(written(tmp_path, "a.yaml", f"{NODE}amcl:\n  alpha1: 0.2\n"))
    assert caught.value.where.endswith("a.yaml:5")


def test_a_namespace_is_for_ros_files(tmp_path: Path) -> None:
    path = written(tmp_path, "a.param", "A 1\n")
    with pytest.raises(ConfigError, match="Only ROS parameters have namespaces"):
        read_configs([f"robot={path}"])
    odd = written(tmp_path, "x=y.param", "A 1\n")
    assert values(read_configs([odd])[0].settings) == {"A": 1.0}
    with pytest.raises(ConfigError, match="No such file"):
        read_configs([f"{tmp_path}/no such=file"])


def test_a_log_is_no_configuration_file(tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    path.write_bytes(b"A 1\n" * 3_000_000)
    with pytest.raises(ConfigError, match="Is it a log"):
        read_config(path)


@pytest.mark.parametrize("row", ["1\t1\tA\t0.5", "1\t1\tA\tx\t9", "1\t1\tA\tnan\t6"])
def test_a_row_that_is_none_is_named(tmp_path: Path, row: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read_config(written(tmp_path, "a.params", f"{QGC}1\t1\tB\t1\t6\n{row}\n"))
    assert caught.value.where.endswith("a.params:3")


FLOAT32 = st.floats(-1e6, 1e6, width=32).map(lambda value: float(f"{value:.7g}"))
PARAMETER = st.from_regex(r"[A-Z][A-Z0-9_]{0,14}", fullmatch=True)
WORD = st.from_regex(r"[a-zA-Z][a-zA-Z0-9_]{0,8}", fullmatch=True)
ROS_VALUE = st.one_of(
    st.integers(-(10**6), 10**6),
    st.floats(-1e6, 1e6).map(lambda value: float(f"{value:.9g}")),
    st.sampled_from(["true", "false", "[1.0, 2.5]", "[[0.1, 0.2], [0.3, 0.4]]", "dwa", "a: b", "5", "", "#x"]),
)


def read_back(tmp: Path, given: dict[str, float | str], format: Dialect) -> dict[str, float | str]:
    settings = {name: Setting(name, value, "made") for name, value in given.items()}
    remarks = dict.fromkeys(list(given)[::2], "1 -> 2 at 00:10")
    path = written(tmp, "a.txt", write_params(settings, format, remarks))
    (file,) = read_configs([path])
    assert file.format is format or not given
    return values(file.settings)


@given(given=st.dictionaries(PARAMETER, FLOAT32, max_size=20))
def test_written_parameters_read_back(tmp_path_factory: pytest.TempPathFactory, given: dict[str, float | str]) -> None:
    assert read_back(tmp_path_factory.mktemp("a"), given, ARDUPILOT_PARAM) == given


@given(given=st.dictionaries(PARAMETER, st.one_of(FLOAT32, st.integers(-(2**31), 2**31 - 1)), max_size=20))
def test_written_rows_read_back_with_their_types(
    tmp_path_factory: pytest.TempPathFactory, given: dict[str, float | str]
) -> None:
    read = read_back(tmp_path_factory.mktemp("a"), given, QGC_PARAMS)
    assert read == given
    assert [type(read[name]) for name in given] == [type(value) for value in given.values()]


@settings(max_examples=examples(30), deadline=None)
@given(given=st.dictionaries(st.lists(WORD, min_size=1, max_size=4).map(tuple), ROS_VALUE, max_size=6))
def test_written_ros_parameters_read_back_with_their_types(
    tmp_path_factory: pytest.TempPathFactory, given: dict[tuple[str, ...], float | str]
) -> None:
    folder = tmp_path_factory.mktemp("a")
    # Two parameters of one path, one with a namespace named like the other, cannot both be in a ROS 1 file.
    ros1 = {"/".join(k): v for k, v in given.items() if not any(k == o[: len(k)] for o in given if o != k)}
    ros2 = {f"/{k[0]}.{'.'.join(('x', *k[1:]))}": v for k, v in given.items()}
    for names, format in ((ros1, ROS1_YAML), (ros2, ROS2_YAML)):
        read = read_back(folder, names, format)
        assert read == names
        assert [type(read[name]) for name in names] == [type(value) for value in names.values()]


def test_a_remark_stands_by_its_parameter() -> None:
    settings = {name: Setting(name, 3.0, "made") for name in ("/n.A.b", "/n.c")}
    assert write_params(settings, ROS2_YAML, {"/n.A.b": "2.0 -> 3.0 at 00:10"}) == (
        "/n:\n  ros__parameters:\n    A:\n      b: 3.0  # 2.0 -> 3.0 at 00:10\n    c: 3.0\n"
    )
    settings = {"A": Setting("A", 3, "made")}
    assert write_params(settings, ARDUPILOT_PARAM, {"A": "why"}) == "A,3  # why\n"
    assert write_params(settings, QGC_PARAMS, {"A": "why"}) == f"{QGC}# A: why\n1\t1\tA\t3\t6\n"


def test_the_diff_shows_only_what_changes() -> None:
    diagnosis = made_diagnosis()
    assert diagnosis.fix is not None
    lines = unified_diff(diagnosis.run, diagnosis.fix.changes).splitlines()
    assert lines[:2] == ["--- as driven", "+++ suggested"]
    assert lines[3:] == ["-LAND_SPEED,16", "+LAND_SPEED,50"]
    typed = unified_diff(diagnosis.run, diagnosis.fix.changes, by_hand=True).splitlines()
    assert typed[1] == "+++ chosen by hand"


def test_a_fix_that_changes_nothing_has_no_diff() -> None:
    diagnosis = made_diagnosis()
    assert diagnosis.fix is not None
    fix = replace(diagnosis.fix, changes=(Change(LAND_SPEED, DRIVEN, DRIVEN),))
    assert unified_diff(diagnosis.run, fix.changes) == ""


def test_commands_of_each_ecosystem() -> None:
    reboots = replace(LAND_SPEED, reboot_required=True)
    assert format_for("dataflash-bin") is ARDUPILOT_PARAM
    assert apply_commands([Change(reboots, 16.0, 50.0)], ARDUPILOT_PARAM) == [
        "param set LAND_SPEED 50",
        "reboot",
    ]
    occdist = Variable("occdist_scale", Role.OPTION, parameters=("/move_base/DWAPlannerROS/occdist_scale",))
    samples = Variable("samples", Role.OPTION, "int", parameters=("/move_base/a/n", "/move_base/b/n"))
    assert apply_commands([Change(occdist, 0.1, 1.0), Change(samples, 3.0, 6.0)], ROS1_YAML) == [
        "rosrun dynamic_reconfigure dynparam set /move_base/DWAPlannerROS occdist_scale 1.0",
        "rosrun dynamic_reconfigure dynparam set /move_base/a n 6",
        "rosrun dynamic_reconfigure dynparam set /move_base/b n 6",
    ]


def test_commands_of_ros_2() -> None:
    speed = Variable("speed", Role.OPTION, parameters=(MAX_VEL,))
    plugin = Variable("rate", Role.OPTION, reboot_required=True, parameters=("/a.rate",))
    assert apply_commands([Change(speed, 0.5, 1.0), Change(plugin, 20.0, 10.0)], format_for("mcap")) == [
        "ros2 param set /controller_server FollowPath.max_vel_x 1.0",
        "# in the parameter file of /a: rate: 10.0, then start it again",
    ]


def test_the_format_of_a_log() -> None:
    assert format_for("px4-ulg") is QGC_PARAMS
    assert format_for("mavlink-tlog") is ARDUPILOT_PARAM
    assert format_for("ros2-db3") is ROS2_YAML
    assert format_for("mcap") is ROS2_YAML
    assert format_for("mcap", [MAX_VEL]) is ROS2_YAML
    assert format_for("mcap", ["/move_base/DWAPlannerROS/sim_time"]) is ROS1_YAML


def test_every_recorded_configuration_is_read_and_written_back(
    recorded: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = recorded / "logs" / "configs"
    formats = {
        "ardupilot_param": {ARDUPILOT_PARAM, QGC_PARAMS},
        "px4_params": {QGC_PARAMS},
        "ros1_nav": {ROS1_YAML},
        "nav2": {ROS2_YAML},
    }
    files = [path for path in folder.rglob("*") if path.is_file()]
    assert len(files) > 30
    for path in files:
        (file,) = read_configs([path])
        assert file.settings
        assert file.format in formats[path.relative_to(folder).parts[0]]
        again = read_back(tmp_path_factory.mktemp("again"), values(file.settings), file.format)
        assert again.keys() == file.settings.keys()
        assert all(again[name] == pytest.approx(value, rel=1e-6) for name, value in values(file.settings).items())


@pytest.mark.parametrize("format", [ARDUPILOT_PARAM, QGC_PARAMS])
def test_a_damaged_name_forges_no_line(tmp_path: Path, format: Dialect) -> None:
    names = ("A", "B,1\nFENCE_ENABLE", "\x1b[31mC", "D\t9", "")
    text = write_params({name: Setting(name, 2.0, "PARM") for name in names}, format)
    assert "\x1b" not in text
    path = tmp_path / "a.param"
    path.write_text(text)
    assert {name: setting.value for name, setting in read_config(path).items()} == {"A": 2.0}
