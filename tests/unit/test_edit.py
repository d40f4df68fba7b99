"""Changes put into configuration files, and two configurations compared."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from care_core.configs.compare import Side, compare
from care_core.configs.driven import same_value
from care_core.configs.edit import Wanted, apply_changes
from care_core.configs.loading import ConfigFile, read_config, read_text
from care_core.errors import ConfigError
from care_core.run import Setting
from care_core.variables import Role, Variable
from tests.conftest import Care
from tests.whole import examples

SPEED = Variable("speed", Role.OPTION, parameters=("/move_base/DWA/max_vel",))
COUNT = Variable("count", Role.OPTION, "int", reboot_required=True, parameters=("/move_base/DWA/count",))
RADIUS = Variable("radius", Role.OPTION, parameters=("/move_base/global_costmap/r", "/move_base/local_costmap/r"))
LAND = Variable("LAND_SPEED", Role.OPTION, "int", parameters=("LAND_SPEED",))


def wanted(option: Variable, value: float) -> list[Wanted]:
    return [Wanted(option, parameter, value) for parameter in option.parameters]


def written(tmp_path: Path, name: str, text: str) -> str:
    path = tmp_path / name
    path.write_bytes(text.encode())
    return str(path)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("DWA:\n  # why\n  max_vel: 0.5   # m/s\n  b: 1\n", "DWA:\n  # why\n  max_vel: 0.7   # m/s\n  b: 1\n"),
        ("DWA: {max_vel: 0.5, b: 2}\n", "DWA: {max_vel: 0.7, b: 2}\n"),
        ("DWA: {b: 2, max_vel: 0.5}  # x\n", "DWA: {b: 2, max_vel: 0.7}  # x\n"),
        ("DWA:\r\n  max_vel: 5e-1\r\n", "DWA:\r\n  max_vel: 0.7\r\n"),
        ("\ufeffDWA:\n  'max_vel': 0.5", "\ufeffDWA:\n  'max_vel': 0.7"),
        ("DWA/max_vel: 0.5\n", "DWA/max_vel: 0.7\n"),
    ],
)
def test_only_the_value_of_a_yaml_line_is_touched(tmp_path: Path, before: str, after: str) -> None:
    (file,) = apply_changes([written(tmp_path, "a.yaml", before)], wanted(SPEED, 0.7))
    assert file.before == before
    assert file.after == after
    assert file.edits[0].before == 0.5
    assert file.edits[0].where.startswith(f"{file.path}:")


@pytest.mark.parametrize(
    "text",
    ["DWA:\n  max_vel: &v 0.5\n  other: *v\n", "DWA:\n  max_vel:\n    0.5\n", "base: &b {max_vel: 0.5}\nDWA: *b\n"],
)
def test_a_line_that_cannot_be_edited_safely_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigError):
        apply_changes([written(tmp_path, "a.yaml", text)], wanted(SPEED, 0.7))


@pytest.mark.parametrize(
    "line", ["LAND_SPEED,50", "LAND_SPEED 50", "LAND_SPEED  ,  50  # soft", "1\t1\tLAND_SPEED\t50\t6"]
)
def test_a_vehicle_parameter_keeps_its_line(tmp_path: Path, line: str) -> None:
    before = f"# head\n{line}\n" if "\t" not in line else f"# Vehicle-Id Component-Id Name Value Type\n{line}\n"
    (file,) = apply_changes([written(tmp_path, "a.param", before)], wanted(LAND, 40))
    assert file.after == before.replace("50", "40")


@pytest.mark.parametrize(
    ("held", "driven", "says"),
    [
        ("5", 9.757, "has this already, and the robot ran 9.757"),
        ("7", 9.757, "has 7 but the robot ran 9.757"),
        ("9.75712", 9.757, ""),
        ("7", None, ""),
    ],
)
def test_a_file_that_was_not_driven_is_told(tmp_path: Path, held: str, driven: float | None, says: str) -> None:
    speed = Variable("WP_SPEED", Role.OPTION, parameters=("WP_SPEED",))
    named = written(tmp_path, "rover.parm", f"WP_SPEED,{held}\n")
    (file,) = apply_changes([named], [Wanted(speed, "WP_SPEED", 5.0, driven)])
    assert [note for note in file.edits[0].notes if says in note] == file.edits[0].notes
    assert bool(file.edits[0].notes) is bool(says)


def test_a_vehicle_parameter_that_is_missing_is_added_with_a_note(tmp_path: Path) -> None:
    (file,) = apply_changes([written(tmp_path, "a.param", "RTL_ALT 1500")], wanted(LAND, 40))
    assert file.after == "RTL_ALT 1500\nLAND_SPEED,40\n"
    assert file.edits[0].before is None
    assert "added" in file.edits[0].notes[0]


def test_a_ros_parameter_that_is_missing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="No file holds /move_base/DWA/max_vel"):
        apply_changes([written(tmp_path, "a.yaml", "other: 1\n")], wanted(SPEED, 0.7))


def test_one_line_for_both_costmaps_is_set_once_and_said(tmp_path: Path) -> None:
    (file,) = apply_changes([written(tmp_path, "common.yaml", "r: 0.5\n")], wanted(RADIUS, 0.3))
    assert file.after == "r: 0.3\n"
    (edit,) = file.edits
    assert edit.parameters == list(RADIUS.parameters)
    assert "every node that loads it" in edit.notes[0]
    other = [Wanted(RADIUS, RADIUS.parameters[0], 0.3), Wanted(RADIUS, RADIUS.parameters[1], 0.4)]
    with pytest.raises(ConfigError, match="different values"):
        apply_changes([str(file.path)], other)


def test_the_file_that_is_loaded_last_is_the_one_that_is_changed(tmp_path: Path) -> None:
    first = written(tmp_path, "a.yaml", "DWA:\n  max_vel: 0.5\n  count: 3\n")
    second = written(tmp_path, "b.yaml", "max_vel: 0.6\n")
    one, two = apply_changes([first, f"move_base/DWA={second}"], [*wanted(SPEED, 0.7), *wanted(COUNT, 4)])
    assert one.after == "DWA:\n  max_vel: 0.5\n  count: 4\n"
    assert two.after == "max_vel: 0.7\n"
    assert "restart" in one.edits[0].notes[0]


def test_ros_2_files_are_edited_by_node(tmp_path: Path) -> None:
    option = Variable("v", Role.OPTION, parameters=("/controller_server.FollowPath.max_vel_x",))
    text = "controller_server:\n  ros__parameters:\n    FollowPath:\n      max_vel_x: 0.26  # m/s\n"
    (file,) = apply_changes([written(tmp_path, "nav2.yaml", text)], wanted(option, 0.4))
    assert file.after == text.replace("0.26", "0.4")


NAMES = st.lists(st.from_regex(r"[A-Z]{3,6}_[A-Z]{2,4}", fullmatch=True), min_size=1, max_size=8, unique=True)


@settings(max_examples=examples(40), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(names=NAMES, old=st.floats(-1e4, 1e4, width=32), new=st.floats(-1e4, 1e4, width=32), data=st.data())
def test_applying_then_comparing_gives_the_change(
    tmp_path: Path, names: list[str], old: float, new: float, data: st.DataObject
) -> None:
    path = written(tmp_path, "a.param", "".join(f"{name},{old!r}  # {name}\n" for name in names))
    name = data.draw(st.sampled_from(names))
    (file,) = apply_changes([path], wanted(Variable(name, Role.OPTION, parameters=(name,)), new))
    changed = written(tmp_path, "b.param", file.after)
    a, b = Side("a", read_config(path)), Side("b", read_config(changed))
    differing = [difference.parameter for difference in compare(a, b, everything=True)]
    assert differing == ([] if same_value(old, b.settings[name].value) else [name])
    assert compare(a, a) == ()
    assert [line.partition("#")[2] for line in file.after.splitlines()] == [f" {one}" for one in names]


def test_comparing_hides_what_nobody_chooses_and_rounds_like_a_vehicle() -> None:
    def side(**values: float | str) -> Side:
        return Side("x", {name: Setting(name, value, "f") for name, value in values.items()})

    a = side(STAT_RUNTIME=1.0, RTL_ALT=0.1, flag="true", only=1.0)
    b = side(STAT_RUNTIME=2.0, RTL_ALT=0.10000000149, flag=1.0, other=1.0)
    assert [str(one) for one in compare(a, b)] == ["- only  1", "+ other  1"]
    assert [one.parameter for one in compare(a, b, everything=True)] == ["STAT_RUNTIME", "only", "other"]
    partial = Side("report", {"RTL_ALT": Setting("RTL_ALT", 5.0, "r")}, partial=True)
    assert [str(one) for one in compare(a, partial)] == ["! RTL_ALT  0.1 -> 5"]


# Commands

SAMPLE = Path(__file__).parents[2] / "samples/arducopter_failed.BIN"


@pytest.fixture
def files(care: Care, tmp_path: Path) -> tuple[Path, Path]:
    report, config = tmp_path / "report.yaml", tmp_path / "driven.param"
    care("triage", SAMPLE, "--no-history", "--out", report)
    config.write_text("# my vehicle\nLAND_SPEED 16 # soft\nRTL_ALT 1500\n", encoding="utf-8")
    return report, config


def test_apply_prints_a_patch_and_leaves_the_file(care: Care, files: tuple[Path, Path]) -> None:
    report, config = files
    before = config.read_bytes()
    code, out, err = care("apply", report, config)
    assert code == 0
    assert "-LAND_SPEED 16 # soft\n+LAND_SPEED 40 # soft" in out
    assert f"{config}:2: LAND_SPEED  16 -> 40" in err
    assert config.read_bytes() == before


def test_apply_writes_a_new_file_and_diff_shows_it(care: Care, files: tuple[Path, Path], tmp_path: Path) -> None:
    report, config = files
    new = tmp_path / "new.param"
    assert care("apply", report, config, "-o", new).code == 0
    code, out, _ = care("diff", config, new)
    assert (code, out) == (1, "! LAND_SPEED  16 -> 40\n")
    assert care("diff", new, new).code == 0
    assert care("diff", new, SAMPLE).code == 1
    assert care("diff", SAMPLE, report).stdout == "! LAND_SPEED  16 -> 40\n"
    assert care("diff", SAMPLE, tmp_path / "none").code == 2


def test_apply_in_place_keeps_a_backup_each_time(care: Care, files: tuple[Path, Path]) -> None:
    report, config = files
    before = config.read_text(encoding="utf-8")
    assert care("apply", report, config, "--in-place").code == 0
    assert care("apply", report, config, "--in-place").code == 0
    assert "LAND_SPEED 40 # soft" in config.read_text(encoding="utf-8")
    assert config.with_name("driven.param.bak").read_text(encoding="utf-8") == before
    assert config.with_name("driven.param.bak1").exists()


def test_apply_refuses_what_it_cannot_do(care: Care, files: tuple[Path, Path], tmp_path: Path) -> None:
    report, config = files
    assert care("apply", report, config, "-o", config).code == 2
    assert care("apply", report, config, "-o", tmp_path / "x", "--in-place").code == 2
    assert care("apply", report, config, "--alternative", "9").code == 2
    assert care("apply", report, tmp_path / "none.param").code == 2
    assert care("apply", config, config).code == 2


def test_two_keys_on_one_line_are_set_each(tmp_path: Path) -> None:
    other = Variable("b", Role.OPTION, parameters=("/move_base/DWA/b",))
    named = written(tmp_path, "a.yaml", "DWA: {max_vel: 0.5, b: 2.0}\n")
    (file,) = apply_changes([named], [*wanted(SPEED, 0.7), *wanted(other, 0.7)])
    assert file.after == "DWA: {max_vel: 0.7, b: 0.7}\n"


def test_a_file_that_two_costmaps_load_is_edited_once_and_says_who_else_reads_it(tmp_path: Path) -> None:
    named = written(tmp_path, "common.yaml", "r: 0.5\n")
    both = [f"move_base/global_costmap={named}", f"move_base/local_costmap={named}"]
    (file,) = apply_changes(both, wanted(RADIUS, 0.7)[:1])
    assert file.after == "r: 0.7\n"
    assert file.edits[0].shared == {"move_base/local_costmap/r"}

    (file,) = apply_changes(both, wanted(RADIUS, 0.7))
    assert file.edits[0].parameters == list(RADIUS.parameters)
    assert file.edits[0].shared == set()

    different = [Wanted(RADIUS, RADIUS.parameters[0], 0.7), Wanted(RADIUS, RADIUS.parameters[1], 0.8)]
    with pytest.raises(ConfigError, match="one line"):
        apply_changes(both, different)


def test_a_file_is_read_twice_however_many_changes_go_into_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []

    def counting(text: str, path: Path, namespace: str = "") -> ConfigFile:
        read.append(text)
        return read_text(text, path, namespace)

    monkeypatch.setattr("care_core.configs.edit.read_text", counting)
    options = [Variable(f"p{i}", Role.OPTION, parameters=(f"/n/p{i}",)) for i in range(20)]
    named = written(tmp_path, "n.yaml", "n:\n" + "".join(f"  p{i}: 0.5\n" for i in range(20)))
    (file,) = apply_changes([named], [Wanted(one, one.parameters[0], 0.7) for one in options])
    assert file.after == file.before.replace("0.5", "0.7")
    assert len(read) == 1  # beside the first reading, which `read_configs` does


def test_a_recorded_configuration_keeps_every_byte_and_a_change_is_the_only_difference(
    recorded: Path, tmp_path: Path
) -> None:
    files = [path for path in (recorded / "logs" / "configs").rglob("*") if path.is_file()]
    assert len(files) > 30
    for path in files:
        (file,) = apply_changes([str(path)], [])
        assert file.after.encode() == path.read_bytes()
        held = file.loads[0].settings
        numbers = [one for one in held.values() if isinstance(one.value, (int, float))][::7]
        changes = []
        for one in numbers:
            option = Variable("o", Role.OPTION, "int" if isinstance(one.value, int) else "float")
            changes.append(Wanted(option, one.name, 3 * float(one.value) + 5))
        (file,) = apply_changes([str(path)], changes)
        copy = tmp_path / f"copy{path.suffix}"
        copy.write_bytes(file.after.encode())
        found = compare(Side("a", held, file.format), Side("b", read_config(copy), file.format), everything=True)
        assert {one.parameter for one in found} == {one.name for one in numbers}
