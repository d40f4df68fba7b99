"""What is known of parameters without a log, and with one."""

from __future__ import annotations

from pathlib import Path

import pytest

from care_core.application.describing import known_of
from care_core.ecosystems.vehicles import is_self_written
from care_core.metadata import ardupilot, navigation
from care_core.metadata.fact import expanded
from care_core.metadata.words import word_of
from care_core.run import Setting
from care_core.variables import Role, Variable
from tests.whole import one_in


def test_a_parameter_of_a_vehicle_is_told_by_release() -> None:
    old = ardupilot.fact_of("WPNAV_SPEED", "copter", (4, 5, 4))
    assert old is not None
    assert (old.low, old.high, old.unit) == (20.0, 2000.0, "cm/s")
    assert old.source.startswith("ArduPilot's parameter list, Copter")
    assert ardupilot.Release("C", "4.8") not in ardupilot.known_in("WPNAV_SPEED")
    assert ardupilot.known_in("SERVO16_FUNCTION")
    assert not ardupilot.known_in("NO_SUCH_NAME")
    receiver = ardupilot.fact_of("GPS1_TYPE", "rover")
    assert receiver is not None
    assert receiver.reboot


@pytest.mark.parametrize("vehicle", list(ardupilot.RELEASES))
def test_every_release_documents_hundreds_of_parameters(vehicle: str) -> None:
    for version in ardupilot.RELEASES[vehicle]:
        known = sum(ardupilot.Release(vehicle, version) in ardupilot.known_in(name) for name in ardupilot.names())
        assert known > 500


def test_calibration_and_what_is_read_only_are_nobody_s_choice() -> None:
    listed = [
        fact
        for name in one_in(6, ardupilot.names())
        for fact in ardupilot.facts_of(name)
        if fact.read_only and not name.startswith("VTX_")
    ]
    assert len(listed) > 10
    assert [fact.name for fact in listed if not is_self_written(fact.name)] == []


def test_every_line_is_of_a_parameter_that_is_known_as_its_owner_reads_it() -> None:
    table = Path(navigation.__file__).with_name("words.tsv").read_text(encoding="utf-8")
    rows = [tuple(line.split("\t")) for line in table.splitlines() if not line.startswith("#")]
    read = {
        (owner, name)
        for ros in navigation.STACKS
        for owner in navigation.owners(ros)
        for name in navigation.keys_of(ros, owner)
    }
    known = {("ros", owner, name) for owner, name in read} | {("ros", "", name) for _, name in read}
    known |= {("ardupilot", "", name) for name in ardupilot.names()}
    families = {row[:3]: [(row[0], row[1], name) for name in expanded(row[2])] for row in rows}
    assert [row for row, names in families.items() if known.isdisjoint(names)] == []
    assert [row[2] for row in rows if len(row[4]) > 72 or row[4].endswith(".")] == []
    assert rows == sorted(rows)
    assert len(families) == len(rows)
    written = [name for names in families.values() for name in names]
    assert len(set(written)) == len(written)


def test_a_default_that_moved_under_one_name_is_told_by_distribution() -> None:
    path = "/move_base/DWAPlannerROS/path_distance_bias"
    kinetic, noetic = (navigation.fact_of("ros1", path, name) for name in ("kinetic", "noetic"))
    assert kinetic is not None
    assert noetic is not None
    assert (kinetic.default_number, noetic.default_number) == (32.0, 0.6)


def test_the_log_s_own_description_stands_before_the_table_and_each_bound_names_its_source() -> None:
    path = "/move_base/DWAPlannerROS/sim_time"
    option = Variable("sim_time", Role.OPTION, range=(0.5, 3.0), default=1.7, unit="s", parameters=(path,))
    setting = Setting(path, 2.0, "/parameter_updates", default=1.5, low=0.1, high=4.0)
    known = [(one.what, one.text, one.source) for one in known_of(option, {path: setting}, {})]
    assert ("Range", "0.1 to 4", "the log's own description") in known
    assert ("Default", "1.5", "the log") in known
    assert ("Acceptable", "0.5 to 3 s", "profile: what may be suggested") in known
    assert any(what == "Range" and text == "0 to any" and "noetic" in source for what, text, source in known)


def test_what_nothing_is_known_of_is_told_by_its_profile_alone() -> None:
    option = Variable("mine", Role.OPTION, range=(0.0, 1.0), parameters=("/somebody/mine",))
    assert {one.what for one in known_of(option, {}, {})} == {"Parameter", "Type", "Acceptable", "Restart"}


def test_a_family_of_names_is_written_once() -> None:
    assert list(expanded("SERVO{1..3}_MIN")) == ["SERVO1_MIN", "SERVO2_MIN", "SERVO3_MIN"]
    assert list(expanded("{ATC|Q_A}_RAT{|2}_P")) == ["ATC_RAT_P", "ATC_RAT2_P", "Q_A_RAT_P", "Q_A_RAT2_P"]
    assert list(expanded("RTL_SPEED")) == ["RTL_SPEED"]


@pytest.mark.parametrize("name", ["BATT_MONITOR", "BATT2_MONITOR", "BATT9_MONITOR", "BATTG_MONITOR"])
def test_one_line_serves_a_numbered_family(name: str) -> None:
    fact = ardupilot.fact_of(name, "copter")
    assert fact is not None
    assert fact.line == "what measures this battery; 0 nothing"
    assert not word_of("ros", name).line
