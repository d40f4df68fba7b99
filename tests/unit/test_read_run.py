"""Reading a run: configuration as driven, gates on objectives, missions, evidence; on a log made here."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.configs.driven import disagreements, in_force, option_value
from care_core.ecosystems.base import RunModel
from care_core.ecosystems.measures import EXTRACTORS, MISSION_KINDS, Args, Mission, MissionKind, extractor
from care_core.ecosystems.registry import run_model
from care_core.errors import ProfileError, UsageError
from care_core.extract.read import read_run, read_runs, reading_plan
from care_core.logs import formats
from care_core.logs.base import Channel, Table, Wanted
from care_core.logs.formats import LogFormat
from care_core.profile.schema import EvidenceRule, Schema
from care_core.records import Struct, field
from care_core.run import Damage, Evidence, Setting, Unavailable, Value
from care_core.variables import Extract, Role, Threshold, Variable


class MadeLog(Struct, eq=False):
    """A log with a `track` of x over time and markers where missions begin and end."""

    path: Path
    known: Mapping[str, tuple[Setting, ...]] = field(default_factory=dict)
    spans: tuple[tuple[float, float, bool], ...] = ((0.0, 10.0, True),)
    facts: Mapping[str, str] = field(default_factory=dict)
    format: LogFormat = formats.DATAFLASH_BIN
    start: str | None = None
    duration_s: float = 20.0
    damage: tuple[Damage, ...] = ()
    reads: int = 0

    def channels(self) -> tuple[Channel, ...]:
        return (Channel("track", "T", 21),)

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return self.known

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        self.reads += 1
        assert wanted == {"marks": ("start", "end", "ended"), "track": ("x",)}
        t = np.arange(21.0)
        marks = np.array(self.spans, dtype=float).reshape(-1, 3)
        columns = {"start": marks[:, 0], "end": marks[:, 1], "ended": marks[:, 2]}
        return {"track": Table(t, {"x": t * 2}), "marks": Table(marks[:, 0], columns)}


class MadeMissions(MissionKind):
    name = "made"
    args: Mapping[str, str] = {"mismatch": "what it says of every mission"}

    def needs(self, spec: Args) -> Wanted:
        return {"marks": ("start", "end", "ended")}

    def missions(self, model: RunModel, tables: Mapping[str, Table], spec: Args) -> tuple[Mission, ...]:
        marks = tables["marks"]
        rows = zip(marks["start"], marks["end"], marks["ended"], strict=True)
        return tuple(Mission(model, tables, start, end, bool(ended), spec) for start, end, ended in rows)

    def mismatch(self, mission: Mission) -> str:
        return str(mission.spec.get("mismatch", ""))

    def evidence(self, mission: Mission) -> tuple[Evidence, ...]:
        return (Evidence(1.0, "Arm: Check SPEED setting", "refusal", ("speed",)),)


@pytest.fixture(autouse=True)
def _made_library(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setitem(MISSION_KINDS, "made", MadeMissions())

    @extractor("made_span", needs={"track": ("x",)}, unit="m")
    def made_span(mission: Mission, args: Args) -> Value:
        """Distance between the ends."""
        table = mission.table("track")
        return Unavailable("no track") if table is None else float(np.ptp(table["x"]))

    @extractor("made_constant", needs={}, unit="", args={"value": "what it answers"})
    def made_constant(mission: Mission, args: Args) -> Value:
        """The value of its argument, or of a parameter."""
        return Unavailable("told so") if args["value"] is None else float(args["value"])

    yield
    for name in ("made_span", "made_constant"):
        EXTRACTORS.pop(name)


def made_schema(success: float | None = 1.0, mission: Mapping[str, Any] | None = None) -> Schema:
    variables = (
        Variable("speed", Role.OPTION, parameters=("SPEED", "SPD_OLD")),
        Variable("shape", Role.OPTION, "enum", labels=((0.0, "round"), (1.0, "square")), parameters=("/nav/shape",)),
        Variable("brake", Role.OPTION, "bool", parameters=("/nav/local/brake",)),
        Variable("wind", Role.OPTION, parameters=("SIM_WIND",)),
        Variable("distance", Role.METRIC, unit="m", extract=Extract("made_span")),
        Variable("untold", Role.METRIC),
        Variable(
            "success",
            Role.OBJECTIVE,
            kind="functional",
            threshold=Threshold(">=", 1.0),
            extract=Extract("made_constant", {"value": success}),
        ),
        Variable(
            "energy",
            Role.OBJECTIVE,
            kind="non-functional",
            threshold=Threshold("<=", 5.0),
            extract=Extract("made_constant", {"value": 4.0}),
        ),
    )
    return Schema(
        name="made",
        version="1",
        platform="a made one",
        doc="",
        match={},
        logs=("dataflash-bin",),
        observational=False,
        mission={"kind": "made"} if mission is None else mission,
        evidence=(EvidenceRule("check speed", {"brake": None, "speed": None}, "too fast"),),
        variables={variable.name: variable for variable in variables},
    )


@pytest.fixture
def log(tmp_path: Path) -> MadeLog:
    path = tmp_path / "made.bin"
    path.write_bytes(b"made")
    return MadeLog(path)


def as_driven(*values: Setting) -> dict[str, tuple[Setting, ...]]:
    return {values[0].name: values}


def test_a_run_holds_what_the_log_drove_and_its_provenance(log: MadeLog) -> None:
    log.known = as_driven(Setting("SPEED", 3.0, "PARM"))
    run = read_run(run_model(log), made_schema())
    assert run.config == {"speed": 3.0}
    assert run.metrics["distance"] == 20.0
    assert isinstance(run.metrics["untold"], Unavailable)
    assert run.objectives == {"success": 1.0, "energy": 4.0}
    assert run.log.sha256 == sha256(b"made").hexdigest()
    assert (run.mission.index, run.mission.count, run.mission.fits) == (1, 1, True)
    assert log.reads == 1


@pytest.mark.parametrize(("changed_at_s", "driven"), [(9.0, 3.0), (2.0, 4.0), (-1.0, 4.0)])
def test_the_value_in_force_for_most_of_the_mission_counts(log: MadeLog, changed_at_s: float, driven: float) -> None:
    log.known = as_driven(
        Setting("SPEED", 3.0, "PARM"),
        Setting("SPEED", 4.0, "PARM", changed_at_s=changed_at_s),
        Setting("SPEED", 5.0, "PARM", changed_at_s=11.0),
    )
    assert read_run(run_model(log), made_schema()).config["speed"] == driven


def test_a_value_that_comes_back_counts_for_all_of_its_time(log: MadeLog) -> None:
    log.known = as_driven(
        Setting("SPEED", 3.0, "PARM"),
        Setting("SPEED", 4.0, "PARM", changed_at_s=3.5),
        Setting("SPEED", 3.0, "PARM", changed_at_s=8.0),
    )
    assert read_run(run_model(log), made_schema()).config["speed"] == 3.0


def test_any_parameter_of_an_option_will_do(log: MadeLog) -> None:
    log.known = as_driven(Setting("SPD_OLD", 7.0, "PARM"))
    assert read_run(run_model(log), made_schema()).config["speed"] == 7.0


def test_simulator_parameters_are_never_options(log: MadeLog) -> None:
    log.known = as_driven(Setting("SIM_WIND", 9.0, "PARM"))
    assert "wind" not in read_run(run_model(log), made_schema()).config


def test_words_become_the_numbers_that_options_use() -> None:
    shape, brake = (made_schema().variables[name] for name in ("shape", "brake"))
    assert option_value(shape, Setting("/nav/shape", "Square", "file")) == 1.0
    assert option_value(brake, Setting("/nav/local/brake", "True", "file")) == 1.0
    assert option_value(brake, Setting("/nav/local/brake", "no", "file")) == 0.0
    assert option_value(brake, Setting("/nav/local/brake", "perhaps", "file")) is None
    assert option_value(brake, Setting("/nav/local/brake", float("nan"), "file")) is None


def test_a_file_fills_what_the_log_lacks_and_is_contradicted_by_what_it_holds(log: MadeLog) -> None:
    log.known = as_driven(Setting("SPEED", 3.0, "PARM"))
    overrides = {
        "SPEED": Setting("SPEED", 9.0, "a.param:4"),
        "/nav/local/brake": Setting("local/brake", "true", "b.yaml:2"),
    }
    schema = made_schema()
    run = read_run(run_model(log), schema, overrides=overrides)
    assert run.config == {"speed": 3.0, "brake": 1.0}
    assert run.settings["/nav/local/brake"].source == "b.yaml:2"
    (sentence,) = disagreements(schema.options, run.settings, overrides)
    assert "speed was 3" in sentence
    assert "a.param:4" in sentence


def test_every_objective_is_read_and_none_judged(log: MadeLog) -> None:
    log.spans = ((0.0, 20.0, False),)
    schema = made_schema(0.0, mission={"kind": "made", "mismatch": "it has 3 waypoints, not 5"})
    run = read_run(run_model(log), schema)
    assert run.objectives == {"success": 0.0, "energy": 4.0}
    assert (run.mission.ended, run.mission.fits, run.mission.mismatch) == (False, False, "it has 3 waypoints, not 5")


@pytest.mark.parametrize(
    ("end_s", "damage_s", "ended"),
    [(20.0, 19.5, False), (20.0, None, False), (20.0, 18.5, True), (19.0, 18.5, True)],
    ids=["in_its_last_second", "no_one_knows_where", "long_before_its_end", "the_log_goes_on"],
)
def test_a_log_that_breaks_off_while_a_mission_lasts_does_not_end_it(
    log: MadeLog, end_s: float, damage_s: float | None, ended: bool
) -> None:
    log.spans, log.damage = ((0.0, end_s, True),), (Damage("cut", 7, damage_s),)
    assert read_run(run_model(log), made_schema()).mission.ended is ended


def test_the_last_mission_is_taken_unless_another_is_named(log: MadeLog) -> None:
    log.spans = ((0.0, 5.0, True), (6.0, 9.0, True))
    schema = made_schema()
    assert read_run(run_model(log), schema).metrics["distance"] == 6.0
    assert read_run(run_model(log), schema, mission=1).metrics["distance"] == 10.0
    assert [run.mission.index for run in read_runs(run_model(log), schema)] == [1, 2]
    with pytest.raises(UsageError, match="1 to 2"):
        read_run(run_model(log), schema, mission=3)
    with pytest.raises(UsageError):
        read_run(run_model(log), schema, mission=0)


def test_a_log_without_a_mission_is_refused(log: MadeLog) -> None:
    log.spans = ()
    with pytest.raises(ProfileError, match="no mission"):
        read_run(run_model(log), made_schema())


def test_a_profile_of_a_published_table_reads_no_log(log: MadeLog) -> None:
    with pytest.raises(ProfileError, match="reads no logs"):
        read_run(run_model(log), made_schema(mission={}))


def test_an_unknown_mission_kind_names_the_nearest() -> None:
    with pytest.raises(ProfileError, match="ardupilot_flight"):
        reading_plan(made_schema(mission={"kind": "ardupilot_fligth"}))


def test_rules_of_the_profile_add_options_to_evidence(log: MadeLog) -> None:
    (evidence,) = read_run(run_model(log), made_schema()).evidence
    assert evidence.options == ("speed", "brake")
    assert evidence.says == "too fast"


def test_what_changed_during_the_mission_is_kept(log: MadeLog) -> None:
    log.known = as_driven(
        Setting("SPEED", 3.0, "PARM"),
        Setting("SPEED", 4.0, "PARM", changed_at_s=0.5),
        Setting("SPEED", 5.0, "PARM", changed_at_s=4.0),
        Setting("SPEED", 6.0, "PARM", changed_at_s=15.0),
    )
    log.spans = ((1.0, 10.0, True),)
    run = read_run(run_model(log), made_schema())
    assert run.config["speed"] == 5.0
    assert [setting.value for setting in run.changes["SPEED"]] == [4.0, 5.0]
    log.spans = ((5.0, 10.0, True),)
    assert read_run(run_model(log), made_schema()).changes == {}


@given(st.lists(st.floats(0, 100), max_size=6), st.floats(0, 100))
def test_the_value_in_force_is_the_last_change_before(changes: list[float], at_s: float) -> None:
    times = sorted(changes)
    history = [Setting("A", -1.0, "x"), *(Setting("A", float(i), "x", changed_at_s=t) for i, t in enumerate(times))]
    expected = sum(time <= at_s for time in times) - 1.0
    assert in_force(history, at_s).value == expected
