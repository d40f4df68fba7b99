"""Hand-made diagnoses of an ArduCopter flight: what the app shows does not depend on the engine.

The faulty flight landed at 16 cm/s instead of 50: land_time grew, and with it mission_time and energy.
"""

from __future__ import annotations

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
from care_core.records import replace
from care_core.run import Damage, Evidence, Fit, FitVerdict, LogInfo, MissionInfo, ProfileChoice, Run, Setting
from care_core.variables import Change, Role, Threshold, Variable

HOSTILE = "PreArm: [bold]check[/bold] \x1b[31mfences\x1b[0m\u202e"

LAND_SPEED = Variable(
    "LAND_SPEED",
    Role.OPTION,
    "int",
    "cm/s",
    "descent speed of the final stage of landing",
    (30, 200),
    50,
    parameters=("LAND_SPEED",),
)
WPNAV_SPEED = Variable(
    "WPNAV_SPEED",
    Role.OPTION,
    "float",
    "cm/s",
    "horizontal speed between waypoints",
    (100, 2000),
    1000,
    parameters=("WPNAV_SPEED",),
    reboot_required=True,
)
BRD_TYPE = Variable(
    "ARMING_MODE",
    Role.OPTION,
    "enum",
    "",
    "",
    None,
    0,
    ((0, "off"), (1, "on")),
    ("ARMING_MODE", "ARMING_REQUIRE"),
)
MISSION_TIME = Variable(
    "mission_time", Role.OBJECTIVE, unit="s", kind="non-functional", threshold=Threshold("<=", 150.0)
)
ENERGY = Variable("energy", Role.OBJECTIVE, unit="Wh", kind="non-functional", threshold=Threshold("<=", 9.5))
SUCCESS = Variable("success", Role.OBJECTIVE, "bool", kind="functional", threshold=Threshold(">=", 1.0))
PATH_ERROR = Variable("path_error", Role.OBJECTIVE, unit="m", kind="non-functional", threshold=Threshold("<=", 2.0))

OK_SUCCESS = ObjectiveResult(SUCCESS, 1.0, SUCCESS.threshold, "ok")
SLOW = ObjectiveResult(MISSION_TIME, 187.25, MISSION_TIME.threshold, "fault", percentile=0.998)
HUNGRY = ObjectiveResult(ENERGY, 11.3, ENERGY.threshold, "fault", percentile=0.992)
NO_PATH = ObjectiveResult(
    PATH_ERROR, None, PATH_ERROR.threshold, "not_evaluated", "no NKF1 in the log; set LOG_BITMASK to record it"
)

RUN = Run(
    config={"LAND_SPEED": 16.0, "WPNAV_SPEED": 1000.0},
    context={"wind_proxy": 2.1},
    metrics={"land_time": 62.1},
    objectives={"success": 1.0, "mission_time": 187.25, "energy": 11.3},
    settings={"LAND_SPEED": Setting("LAND_SPEED", 16.0, "PARM", default=50.0)},
    log=LogInfo(
        "/flights/00000042.BIN",
        "dataflash-bin",
        "2024-05-04T10:15:00Z",
        246.0,
        "0" * 64,
        damage=(Damage("142 bytes that are no message", byte=1048576, time_s=181.5),),
        facts={"firmware": "ArduCopter V4.3.6", "frame": "QUAD/X"},
    ),
    mission=MissionInfo(1, 2, 12.4, 199.65, ended=True, fits=True),
    evidence=(
        Evidence(3.2, HOSTILE, "refusal", ("ARMING_MODE",)),
        Evidence(137.4, "Land: slow descent", "landing", ("LAND_SPEED",)),
    ),
)

LANDS_SLOWLY = Cause(
    rank=1,
    option=LAND_SPEED,
    path=(
        PathNode("LAND_SPEED", "cm/s", 16.0, 50.0, effect=-0.81, support=0.97),
        PathNode("land_time", "s", 62.1, 20.4, effect=0.94, support=1.0),
        PathNode("mission_time", "s", 187.25, 139.0),
    ),
    path_ace=0.875,
    total_effect=-0.77,
    contribution=0.88,
    current=16.0,
    suggested=50.0,
    predicted=Prediction(139.0, 131.0, 148.0, 0.93),
    p_fixed=0.91,
    confidence="high",
    in_support=False,
)
FLIES_SLOWLY = Cause(
    rank=2,
    option=WPNAV_SPEED,
    path=(
        PathNode("WPNAV_SPEED", "cm/s", 1000.0, 1200.0, effect=-0.31, support=0.42),
        PathNode("mean_speed", "m/s", 6.2, 6.9, effect=-0.55, support=0.88),
        PathNode("mission_time", "s", 187.25, 139.0),
    ),
    path_ace=0.43,
    total_effect=-0.2,
    contribution=0.06,
    current=1000.0,
    suggested=1400.0,
    predicted=Prediction(171.0, 160.0, 183.0, 0.02),
    p_fixed=0.02,
    confidence="low",
    in_support=True,
    notes=(Note("edge seen in few resamples"),),
)
SWITCHED = replace(
    FLIES_SLOWLY,
    rank=3,
    option=BRD_TYPE,
    current=1.0,
    suggested=None,
    predicted=None,
    p_fixed=None,
    notes=(),
    path=(PathNode("ARMING_MODE", "", 1.0, 0.0, effect=None, support=None), FLIES_SLOWLY.path[-1]),
)

OPTIONS = (LAND_SPEED, WPNAV_SPEED, BRD_TYPE)
PREDICTED = {
    "success": Prediction(1.0, 1.0, 1.0, 0.99),
    "mission_time": Prediction(139.0, 131.0, 148.0, 0.93),
    "energy": Prediction(8.2, 7.7, 9.1, 0.95),
}
FIX = Fix((Change(LAND_SPEED, 16.0, 50.0),), 0.91, PREDICTED)
OTHER_FIX = Fix(
    (Change(LAND_SPEED, 16.0, 45.0), Change(WPNAV_SPEED, 1000.0, 1400.0, ("above what the frame was tuned for",))),
    0.84,
    {**PREDICTED, "energy": Prediction(9.6, 8.9, 10.4, 0.46)},
)


def faulty() -> Diagnosis:
    """mission_time and energy outside, LAND_SPEED the cause, path_error not evaluated."""
    return Diagnosis(
        profile=ProfileChoice(
            "arducopter",
            "1.0",
            "ArduCopter SITL quad",
            "most parameters matched (31 of 31)",
            fit=Fit("partly", ("the log is from ArduCopter 4.3.6, the profile was learned on 4.6",)),
        ),
        run=RUN,
        objectives=(OK_SUCCESS, SLOW, HUNGRY, NO_PATH),
        faults=(Fault(SLOW, (LANDS_SLOWLY, FLIES_SLOWLY, SWITCHED)), Fault(HUNGRY, (LANDS_SLOWLY,))),
        fix=FIX,
        alternatives=(OTHER_FIX,),
        notes=("mission_time and energy move together (0.99): one cause explains both",),
    )


MOTOR = Finding(
    kind="motor",
    title="motor 2 lost thrust \x1b[31m",
    onset_s=91.3,
    end_s=110.1,
    severity="critical",
    evidence="output 1950 us for 2.1 s while the rear left sank at 78 deg",
    source="RCOU C2 against ATT Roll; SERVO2_MAX 1950",
    consequences=(
        Finding("attitude", "roll does not follow its demand", 91.5, 95.0, "critical", "48 deg apart", "ATT"),
        Finding("crash", "it hit the ground", 110.1, 110.1, "critical", "", "ERR", after_impact=True),
    ),
)
LOW_SATELLITES = Finding("gps", "few satellites", 3.0, 8.0, "warning", "5, 6 are wanted", "GPS NSats")
HEALTH = Health(
    "ArduCopter V4.3.6, quad X",
    (
        Event(1.0, "vehicle", "ArduCopter V4.3.6", "MSG"),
        Event(12.4, "arming", "armed", "EV"),
        Event(60.0, "mode", f"AUTO {HOSTILE}", "MODE"),
        Event(137.4, "error", "crash check", "ERR"),
    ),
    (MOTOR, LOW_SATELLITES),
)


def fitting(verdict: FitVerdict, *reasons: str) -> ProfileChoice:
    """The profile, and how well it fits."""
    return replace(faulty().profile, fit=Fit(verdict, reasons))


def crashed() -> Diagnosis:
    """The faulty flight, and it lost a motor: hardware and parameters in one ranking; the profile partly fits."""
    return replace(
        faulty(),
        profile=fitting("partly", "the firmware is 4.3.6, the profile's is 4.5", "3 options are not in the log"),
        health=HEALTH,
        hypotheses=(
            Hypothesis("hardware", MOTOR.title, 0.9),
            Hypothesis("parameter", "LAND_SPEED", 0.06),
            Hypothesis("chance", "", 0.04),
        ),
    )


def unfitting() -> Diagnosis:
    """A log that no profile fits: its account and findings are the answer."""
    return replace(
        all_ok(),
        objectives=(),
        profile=fitting("no", "it is a rover, the profile is of a copter", "4 of 33 options are in the log"),
        health=HEALTH,
    )


def all_ok() -> Diagnosis:
    """Every objective within its threshold."""
    fast = ObjectiveResult(MISSION_TIME, 139.0, MISSION_TIME.threshold, "ok")
    return replace(faulty(), objectives=(OK_SUCCESS, fast), faults=(), fix=None, alternatives=(), notes=())


def abstaining() -> Diagnosis:
    """A fault that no option of the profile explains."""
    return replace(
        faulty(),
        faults=(Fault(SLOW, ()),),
        objectives=(OK_SUCCESS, SLOW),
        fix=None,
        alternatives=(),
        abstained="the wind (mean lean 19 deg) is outside what the profile has seen",
    )


def not_evaluated() -> Diagnosis:
    """No fault found, but not everything could be judged; the log stops early."""
    return replace(
        all_ok(), objectives=(OK_SUCCESS, NO_PATH), run=replace(RUN, mission=replace(RUN.mission, ended=False))
    )
