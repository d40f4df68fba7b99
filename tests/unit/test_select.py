"""Which profile is taken for a log, what is said about it, and what is refused."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from care_core.errors import ProfileError
from care_core.extract.coverage import cover
from care_core.extract.select import choose_profile, describe_fit
from care_core.logs.base import Channel, LogFormat, Table, Wanted
from care_core.profile.schema import Schema
from care_core.run import Damage, Setting
from care_core.variables import Role, Variable


@dataclass
class NamedLog:
    """A log of which only names matter."""

    parameters: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()
    facts: Mapping[str, str] = field(default_factory=dict)
    path: Path = Path("a.BIN")
    format: LogFormat = LogFormat.DATAFLASH_BIN
    start: str | None = None
    duration_s: float = 1.0
    damage: tuple[Damage, ...] = ()

    def channels(self) -> tuple[Channel, ...]:
        return tuple(Channel(name, "", 1) for name in self.sources)

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return {name: (Setting(name, 1.0, "PARM"),) for name in self.parameters}

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        raise AssertionError("choosing a profile decodes nothing")


@dataclass(frozen=True)
class Candidate:
    schema: Schema


def candidate(name: str, *parameters: str, match: Mapping[str, str] | None = None) -> Candidate:
    options = {p: Variable(p, Role.OPTION, parameters=(p,)) for p in parameters}
    schema = Schema(
        name, "1", name, "", match or {}, ("dataflash-bin",), False, {"kind": "ardupilot_flight"}, (), options
    )
    return Candidate(schema)


def test_most_parameters_win() -> None:
    log = NamedLog(("A", "B", "C"))
    chosen, choice = choose_profile(log, [candidate("few", "A"), candidate("many", "A", "B", "C", "D")])
    assert chosen.schema.name == choice.name == "many"
    assert choice.reason.startswith("3 of 4 options")


def test_on_a_tie_the_name_decides_and_the_other_is_said() -> None:
    log = NamedLog(("A",), facts={"firmware": "ArduCopter V4.5"})
    rover = candidate("a_rover", "A", match={"firmware": "Rover"})
    copter = candidate("copter", "A", match={"firmware": "arducopter"})
    chosen, choice = choose_profile(log, [rover, copter])
    assert chosen is copter
    assert "a_rover would fit nearly as well" in choice.reason
    assert choice.warnings == ()


def test_what_differs_is_said() -> None:
    log = NamedLog(("A",), facts={"firmware": "Rover V4", "frame": "QUAD/X"})
    copter = candidate("copter", "A", match={"firmware": "ArduCopter", "frame": "QUAD", "stack": "x"})
    assert describe_fit(log, copter).warnings == ("the log's firmware is 'Rover V4', the profile is for 'ArduCopter'",)


def test_sources_count_too() -> None:
    log = NamedLog(sources=("POS", "MODE"))
    assert cover(log, candidate("copter", "A").schema).sources == 2


def test_nothing_fits() -> None:
    log = NamedLog(("Z",))
    with pytest.raises(ProfileError, match=r"No profile fits the log.*one, two"):
        choose_profile(log, [candidate("one", "A"), candidate("two", "B")])
    with pytest.raises(ProfileError, match="'one' does not fit the log"):
        describe_fit(log, candidate("one", "A"))
    other = replace(candidate("bag", "Z").schema, logs=("ros1-bag",))
    with pytest.raises(ProfileError, match="It reads ros1-bag"):
        describe_fit(log, Candidate(other))
    with pytest.raises(ProfileError, match="None of them reads dataflash-bin"):
        choose_profile(log, [Candidate(other), Candidate(other)])
