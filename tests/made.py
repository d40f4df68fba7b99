"""A diagnosis and a log made by hand, with text in it that tries to steer a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from care_core.diagnose.records import (
    Cause,
    Diagnosis,
    Fault,
    Fix,
    Hypothesis,
    Note,
    ObjectiveResult,
    PathNode,
    Prediction,
)
from care_core.ecosystems.findings import Event, Finding, Health
from care_core.logs import formats
from care_core.logs.base import Channel, Table, Wanted
from care_core.logs.formats import LogFormat
from care_core.records import Struct, field
from care_core.run import Damage, Evidence, Fit, LogInfo, MissionInfo, ProfileChoice, Run, Setting, Unavailable
from care_core.variables import Change, Role, Threshold, Variable

HOSTILE = "Arm: \x1b[31m[bold]|red|\x1b]0;title\x07 \u202eback"
DRIVEN = 16.0

LAND_SPEED = Variable(
    "land_speed", Role.OPTION, "int", "cm/s", "descent speed", (30.0, 200.0), 50.0, parameters=("LAND_SPEED",)
)
SUCCESS = Variable("success", Role.OBJECTIVE, "bool", kind="functional", threshold=Threshold(">=", 1.0))
TIME = Variable("mission_time", Role.OBJECTIVE, unit="s", kind="non-functional", threshold=Threshold("<=", 150.0))
ENERGY = Variable("energy", Role.OBJECTIVE, unit="Wh", kind="non-functional", threshold=Threshold("<=", 14.0))


T = np.linspace(0.0, 100.0, 201)
"""Times of the messages of a `MadeLog`, in seconds."""


class MadeLog(Struct, eq=False):
    """Tables as a log."""

    tables: Mapping[str, Mapping[str, Any]]
    types: Mapping[str, str] = field(default_factory=dict)
    path: Path = Path("made.BIN")
    format: LogFormat = formats.DATAFLASH_BIN
    start: str | None = None
    duration_s: float = 100.0
    damage: tuple[Damage, ...] = ()
    facts: Mapping[str, str] = field(default_factory=dict)

    def channels(self) -> tuple[Channel, ...]:
        return tuple(Channel(name, self.types.get(name, name), len(T)) for name in self.tables)

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return {}

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        found = {name: {f: self.tables[name][f] for f in fields if f in self.tables[name]}
                 for name, fields in wanted.items() if name in self.tables}  # fmt: skip
        return {name: Table(T, columns) for name, columns in found.items()}


_LOST = Finding("attitude", "control was lost", 61.5, 70.0, "critical", "80 degrees off", "ATT")
HEALTH = Health(
    "ArduCopter V4.5.4, quad X",
    (Event(1.0, "arming", "armed", "ARM"), Event(3.0, "message", HOSTILE, "MSG")),
    (Finding("motor", f"motor 2 {HOSTILE}", 61.0, 70.0, "critical", f"93% {HOSTILE}", "RCOU", consequences=(_LOST,)),),
)


def made_run() -> Run:
    return Run(
        config={"land_speed": DRIVEN, "shape": 0.5},
        context={"wind": Unavailable("no ATT in the log")},
        metrics={"land_time": 60.0, "broken": float("nan")},
        objectives={"success": 1.0, "mission_time": 190.0, "energy": Unavailable("no BAT in the log")},
        settings={"LAND_SPEED": Setting("LAND_SPEED", DRIVEN, "PARM")},
        log=LogInfo(
            "/flights/a.BIN",
            "dataflash-bin",
            None,
            200.0,
            "0" * 64,
            (Damage(f"lost bytes {HOSTILE}", 12, 3.5),),
            {"firmware": "ArduCopter V4.5.4"},
        ),
        mission=MissionInfo(1, 1, 1.0, 191.0, ended=True, fits=True),
        evidence=(Evidence(3.0, HOSTILE, "refusal", ("land_speed",)),),
    )


def made_diagnosis() -> Diagnosis:
    """mission_time is too long because of land_speed; energy could not be evaluated."""
    late = ObjectiveResult(TIME, 190.0, TIME.threshold, "fault", percentile=0.99)
    cause = Cause(
        rank=1,
        option=LAND_SPEED,
        path=(
            PathNode("land_speed", "cm/s", DRIVEN, 50.0, -0.8, 0.97),
            PathNode("land_time", "s", 60.0, 20.0, 0.9, float("nan")),
            PathNode("mission_time", "s", 190.0, 140.0),
        ),
        path_ace=0.85,
        total_effect=-0.8,
        contribution=0.9,
        current=DRIVEN,
        suggested=50.0,
        predicted=Prediction(140.0, 130.0, 149.0, 0.92),
        p_fixed=0.9,
        confidence="high",
        in_support=True,
        notes=(Note(f"note {HOSTILE}"),),
    )
    fix = Fix(
        (Change(LAND_SPEED, DRIVEN, 50.0),),
        0.9,
        {"mission_time": Prediction(140.0, 130.0, 149.0, 0.92), "energy": Prediction(float("inf"), 0.0, 1.0)},
    )
    return Diagnosis(
        profile=ProfileChoice(
            "arducopter", "1.0", "ArduCopter quad", "33 of 33 options", Fit("partly", (f"firmware {HOSTILE}",))
        ),
        run=made_run(),
        objectives=(
            ObjectiveResult(SUCCESS, 1.0, SUCCESS.threshold, "ok"),
            late,
            ObjectiveResult(ENERGY, None, ENERGY.threshold, "not_evaluated", "no BAT in the log"),
        ),
        faults=(Fault(late, (cause,)),),
        fix=fix,
        alternatives=(fix,),
        notes=("time and energy move together",),
        health=HEALTH,
        hypotheses=(
            Hypothesis("parameter", "land_speed", 0.7),
            Hypothesis("hardware", f"motor 2 {HOSTILE}", 0.2),
            Hypothesis("chance", "", 0.1),
        ),
    )
