"""Which profile is taken for a log, what is said about it, and what is refused."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from care_core.causal.model import Summary
from care_core.diagnose.circumstances import unusual
from care_core.diagnose.verdict import fit_line
from care_core.errors import ProfileError
from care_core.extract.coverage import cover
from care_core.extract.read import reading_plan
from care_core.extract.select import choose_profile, fitting_profile
from care_core.logs import formats
from care_core.logs.base import Channel, Table, Wanted
from care_core.logs.formats import LogFormat
from care_core.profile.schema import Schema
from care_core.profile.store import Profile
from care_core.records import Record, Struct, field, replace
from care_core.run import FITS, Damage, Fit, Run, Setting
from care_core.run import OutcomeCheck as RunCheck
from care_core.variables import Role, Variable
from tests.planted import planted_run

SOURCES = tuple(
    reading_plan(Schema("", "", "", "", {}, ("dataflash-bin",), False, {"kind": "ardupilot_flight"}, (), {}))
)


class NamedLog(Struct, eq=False):
    """A log of which only names matter."""

    parameters: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()
    facts: Mapping[str, str] = field(default_factory=dict)
    path: Path = Path("a.BIN")
    format: LogFormat = formats.DATAFLASH_BIN
    start: str | None = None
    duration_s: float = 1.0
    damage: tuple[Damage, ...] = ()

    def channels(self) -> tuple[Channel, ...]:
        return tuple(Channel(name, "", 1) for name in self.sources)

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return {name: (Setting(name, 1.0, "PARM"),) for name in self.parameters}

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        raise AssertionError("choosing a profile decodes nothing")


class Candidate(Record):
    schema: Schema


def candidate(name: str, *parameters: str, match: Mapping[str, str] | None = None) -> Candidate:
    options = {p: Variable(p, Role.OPTION, parameters=(p,)) for p in parameters}
    schema = Schema(
        name, "1", name, "", match or {}, ("dataflash-bin",), False, {"kind": "ardupilot_flight"}, (), options
    )
    return Candidate(schema)


def test_most_parameters_win() -> None:
    log = NamedLog(("A", "B", "C", "D"), SOURCES)
    chosen, choice = choose_profile(log, [candidate("few", "A"), candidate("many", "A", "B", "C", "D", "E")])
    assert chosen is not None
    assert chosen.schema.name == choice.name == "many"
    assert choice.reason.startswith("4 of 5 parameters")


def test_on_a_tie_the_name_decides_and_the_other_is_said() -> None:
    log = NamedLog(("A",), SOURCES, {"frame": "QUAD/X"})
    any_frame = candidate("a_frame", "A")
    quad = candidate("quad", "A", match={"frame": "quad"})
    chosen, choice = choose_profile(log, [any_frame, quad])
    assert chosen is quad
    assert "a_frame would fit nearly as well" in choice.reason


def test_a_log_that_holds_what_the_profile_reads_fits() -> None:
    log = NamedLog(("A",), SOURCES, {"firmware": "ArduCopter V4.5.4"})
    copter = candidate("copter", "A", match={"firmware": "ArduCopter", "vehicle": "copter"})
    assert choose_profile(log, [copter])[1].fit == FITS


def test_what_differs_makes_it_fit_in_part() -> None:
    log = NamedLog(("A",), SOURCES, {"firmware": "ArduCopter V4.5.4", "frame": "HEXA/X"})
    quad = candidate("quad", "A", "B", match={"firmware": "ArduCopter", "frame": "QUAD", "stack": "x"})
    fit = choose_profile(log, [quad])[1].fit
    assert fit.verdict == "partly"
    assert fit.reasons == (
        "the log's frame is 'HEXA/X', the profile is for 'QUAD'",
        "1 of its 2 parameters are in the log",
    )


@pytest.mark.parametrize(
    ("firmware", "verdict"),
    [
        ("ArduCopter V4.0.0", "fits"),
        ("ArduCopter V4.6.3", "fits"),
        ("ArduCopter V3.6.12", "partly"),
        ("ArduCopter V4.7.0", "partly"),
        ("ArduCopter", "partly"),
    ],
)
def test_firmware_outside_the_window_fits_in_part(firmware: str, verdict: str) -> None:
    copter = candidate("copter", "A", match={"firmware": "ArduCopter"})
    within = Candidate(replace(copter.schema, firmware_window=((4, 0), (4, 6))))
    assert choose_profile(NamedLog(("A",), SOURCES, {"firmware": firmware}), [within])[1].fit.verdict == verdict


def test_another_vehicle_does_not_fit_however_much_it_has_in_common() -> None:
    log = NamedLog(("A",), SOURCES, {"firmware": "ArduRover V4.5.4"})
    copter = candidate("copter", "A", match={"firmware": "ArduCopter", "vehicle": "copter"})
    chosen, choice = choose_profile(log, [copter])
    assert chosen is None
    assert (choice.name, choice.fit) == ("copter", Fit("no", ("it is for a copter, this is a rover",)))
    with pytest.raises(ProfileError, match="'copter' does not fit the log: it is for a copter, this is a rover"):
        fitting_profile(log, [copter])


def test_sources_count_too() -> None:
    log = NamedLog(sources=("POS", "MODE"))
    assert cover(log, candidate("copter", "A").schema).sources == 2


def test_nothing_fits() -> None:
    log = NamedLog(("Z",))
    chosen, choice = choose_profile(log, [candidate("one", "A"), candidate("two", "B")])
    assert (chosen, choice.name, choice.fit.verdict) == (None, "", "no")
    other = replace(candidate("bag", "Z").schema, logs=("ros1-bag",))
    assert choose_profile(log, [Candidate(other)])[1].fit.reasons == ("it reads ros1-bag, this is dataflash-bin",)
    assert choose_profile(log, [])[1].fit.reasons == ("no profile is installed",)


def test_a_boat_fits_a_rovers_profile_in_part() -> None:
    rover = candidate("wheels", "A", match={"vehicle": "rover"})
    log = NamedLog(("A",), SOURCES, {"firmware": "ArduRover V4.5.4", "vehicle": "rover"})
    assert choose_profile(log, [rover])[1].fit == FITS
    boat = NamedLog(("A",), SOURCES, {"firmware": "ArduRover V4.5.4", "vehicle": "boat"})
    assert choose_profile(boat, [rover])[1].fit == Fit("partly", ("this is a boat, the profile was learned on wheels",))


def test_a_vtol_is_told_that_no_profile_is_for_it() -> None:
    """On PX4, whose multicopters have one: however it flies just now."""
    copter = candidate("px4", "A", match={"airframe": "multicopter"})
    log = NamedLog(("A",), SOURCES, {"vehicle": "VTOL"})
    chosen, choice = choose_profile(log, [copter, candidate("other", "B", match={"airframe": "boat"})])
    assert chosen is None
    assert fit_line(choice.name, choice.fit) == "No profile fits this log: no profile is for VTOLs of PX4"


def whole(low: float, high: float) -> Summary:
    return Summary(count=100, mean=low, sd=1.0, quantiles=(low, high))


def test_what_training_never_varied_is_said_once_and_last() -> None:
    """Who flies a real vehicle can do nothing about the constants of a simulator."""
    contexts = [Variable(name, Role.CONTEXT, unit="V") for name in ("battery", "dilution", "accuracy", "wind")]
    schema = replace(candidate("copter").schema, variables={one.name: one for one in contexts})
    summaries = {"battery": whole(12.6, 12.6), "dilution": whole(1.21, 1.21), "accuracy": whole(0.9, 0.9),
                 "wind": whole(0.0, 9.0)}  # fmt: skip
    run = planted_run()
    run = replace(run, context={"battery": 16.1, "dilution": 0.6, "accuracy": 0.5, "wind": 20.0})

    def told(run: Run, doc: str = "Learned from simulated flights.") -> tuple[str, ...]:
        model = SimpleNamespace(summaries=summaries)
        return unusual(run, cast("Profile", SimpleNamespace(schema=replace(schema, doc=doc), model=model)))

    wind, constant = told(run)
    assert wind == "wind of 20 V is outside the training runs (0 to 9)"
    assert constant == (
        "it was learned in a simulator that never varied battery (12.6 V), dilution (1.21 V) and 1 more"
    )
    assert told(run, "Learned in the field.")[1].startswith("it was learned from runs that never varied battery")
    flown = replace(run, checks=(RunCheck("armed", 1.0, "it armed"),))
    assert told(flown)[0] == "no mission was flown"
    assert told(replace(flown, context={})) == (), "which alone is no objection"
