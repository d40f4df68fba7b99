"""What an operator does next. A vehicle that lost thrust, crashed or was upset does not fly the same mission again
before it was on the bench, in a simulator or in a hover; one that a simulator flew has nothing to break."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from care_core.diagnose.parts import OUTLASTED, is_pack, mend_first
from care_core.diagnose.records import Diagnosis, Fix, Hypothesis, first_named, helps
from care_core.diagnose.remedies import (
    ASK_WHO_CUT,
    CHARGE,
    CLEAR_REFUSAL,
    LAND_EARLIER,
    LOOK_AT_ITS_WAY,
    LOOK_AT_STEERING,
    TUNE,
    remedy,
)
from care_core.ecosystems.findings import (
    BY_STICK,
    CLOSED,
    CUT,
    DROPPED,
    KILLED,
    NOT_FLOWN,
    STOPPED,
    STRUCK,
    Finding,
    FindingKind,
    every_finding,
)
from care_core.ecosystems.ranking import GRAVITY, LIKELY, SYMPTOMS
from care_core.ecosystems.vehicles import flies, is_simulated, vehicle_of, vehicle_of_run
from care_core.ecosystems.way_back import way_back
from care_core.logs.formats import MAVLINK_TLOG, format_named
from care_core.metadata.causal_map import BUILT_AS, SET_BY_HAND, meaning_of
from care_core.run import Run, shown
from care_core.text import listed

UPSETS: frozenset[FindingKind] = frozenset(("attitude", "crash", "motor", "takeoff", "thrust"))
"""Kinds of findings after which a vehicle may be damaged, or does not do what it is told."""
AGAIN = "run again"
REFUSED = "arming was refused: "
_FAR_AHEAD = 3.0
"""Times as likely as a pack that failed is what is looked at before it."""
KEPT = " kept as it is"
_UPSET_MESSAGES = frozenset(("crash", "thrust"))


def was_upset(run: Run, findings: Iterable[Finding]) -> bool:
    """Whether it lost thrust, crashed or was out of control."""
    return (
        any(one.kind in UPSETS and one.severity == "critical" for one in every_finding(findings))
        or any(one.kind in _UPSET_MESSAGES for one in run.evidence)
        or any(check.name == "no_crash" and check.value == 0.0 for check in run.checks)
    )


def trial(run: Run) -> str:
    """Where what was upset is tried before it runs its mission again."""
    kind = vehicle_of(run.log.facts, {}).kind
    if kind == "plane":
        return "in the simulator or on a short flight close by"
    if kind == "sub":
        return "in the simulator or in shallow water"
    return f"in the simulator or {'a low hover' if not _is_robot(run) and flies(kind) else 'at walking pace'}"


def bench(run: Run) -> str:
    """What to do where it was upset and nothing says why."""
    if is_simulated(run.log.facts, run.settings):
        return "look at the simulator's model, and at the failures that were set in it, before another run"
    place = trial(run)
    parts = "motors, propellers and wiring"
    if "walking" in place:
        parts = "drive, wheels and wiring"
    elif "flight" in place:
        parts = "surfaces and their directions, motor, propeller and wiring"
    return f"check {parts} on the bench, then try it {place}, before another mission"


def again(run: Run, *, upset: bool) -> str:
    """How a change is tried."""
    return f"try it {trial(run)}" if upset and not is_simulated(run.log.facts, run.settings) else AGAIN


def _is_robot(run: Run) -> bool:
    return format_named(run.log.format).ecosystem == "ros"


def next_step(diagnosis: Diagnosis, *, has_failed: bool) -> str:
    """The next step in a sentence, empty where there is nothing to be done."""
    run, findings = diagnosis.run, diagnosis.health.findings
    upset = was_upset(run, findings)
    if diagnosis.fix is not None and not diagnosis.abstained:
        return _of_fix(diagnosis.fix, diagnosis, upset=upset)
    if has_failed and (undone := _undone(diagnosis)):
        return f"{undone}, then {again(run, upset=upset)}" if upset else undone
    named = _named(diagnosis) if has_failed else ()
    if has_failed and upset:
        return _checked(named, findings, run)
    if named:
        return _mended(named, findings, run)
    if has_failed and diagnosis.tell_more:
        return diagnosis.tell_more[0]
    if has_failed and (mended := _of_the_gravest(findings, run)):
        return mended
    return _without_profile(diagnosis) if diagnosis.profile.fit.verdict == "no" else ""


def _mended(named: Iterable[str], findings: Iterable[Finding], run: Run) -> str:
    """What to do about the findings of these titles: of each what its kind calls for, of the others their names. In a
    simulation no part wears out."""
    titled = {one.title: one for one in every_finding(findings)}
    advice: list[str] = []
    set_to_fail: list[str] = []
    untold: list[str] = []
    for name in named:
        one = titled.get(name)
        text = "" if one is None else remedy(one, is_robot=_is_robot(run))
        if one is not None and one.suspect == "hardware" and is_simulated(run.log.facts, run.settings):
            set_to_fail.append(name)
        elif text:
            advice.append(text)
        else:
            untold.append(name)
    if set_to_fail:
        advice.append(f"look for a failure that was set in the simulator, or at its model: {listed(set_to_fail)}")
    if untold:
        advice.append(f"look at what this names: {listed(untold)}")
    return "; ".join(dict.fromkeys(advice))


def _of_the_gravest(findings: Iterable[Finding], run: Run) -> str:
    """What to do about the first critical finding, or warning, where nothing is likely enough to be named as the
    cause."""
    told = [one for one in findings if one.severity != "info" and not one.after_impact]
    gravest = next(iter(sorted(told, key=lambda one: GRAVITY[one.severity])), None)
    return "" if gravest is None else remedy(gravest, is_robot=_is_robot(run))


def _without_profile(diagnosis: Diagnosis) -> str:
    """What to do with a log that no profile fits and in which nothing is seen to have failed."""
    run = diagnosis.run
    if diagnosis.profile.instead:
        return f"take profile {diagnosis.profile.instead}, which fits this log"
    if run.log.format == MAVLINK_TLOG.name and run.log.facts.get("stack") == "PX4":
        return "triage the .ulg that the vehicle itself wrote: profile px4 reads it, and telemetry holds little of it"
    if diagnosis.health.too_little == NOT_FLOWN:
        return "triage a log in which the vehicle was armed; 'care inspect LOG' shows what this one holds"
    if diagnosis.health.too_little and any(not (part.is_jump or part.is_whole) for part in run.log.damage):
        source = "ground station" if run.log.format == MAVLINK_TLOG.name else "vehicle"
        return f"copy the log from the {source} again: this file is damaged, and too little is left of it"
    if diagnosis.health.too_little:
        return "'care inspect LOG' shows what this log holds, 'care record PROFILE' what to record"
    return "'care inspect LOG' tells what each profile would need"


def _checked(named: Iterable[str], findings: Iterable[Finding], run: Run) -> str:
    """What to check before what was upset is tried again: no motor is to blame for what the vehicle estimated wrongly,
    though nothing says why it did."""
    symptoms = {one.title: one.kind for one in findings if one.kind in SYMPTOMS}
    parts = [name for name in named if name not in symptoms]
    then = f"; then {again(run, upset=True)}"
    if parts:
        return f"{_mended(parts, findings, run)}{then}"
    if any(one.title in (CLOSED, CUT, DROPPED, KILLED, STOPPED) for one in findings):
        return f"{ASK_WHO_CUT}{then}"
    if any(one.title == STRUCK for one in findings):
        return f"{LOOK_AT_ITS_WAY}{then}"
    if any(one.title in BY_STICK for one in findings):
        return f"{LOOK_AT_STEERING}{then}"
    swung = next((one.title for one in findings if one.kind == "tuning" and one.severity == "critical"), None)
    if swung is not None:
        return f"{TUNE.format(title=swung)}{then}"
    misled = [name for name in named if symptoms[name] not in UPSETS]
    return f"{_mended(misled, findings, run)}{then}" if misled else bench(run)


def _of_fix(fix: Fix, diagnosis: Diagnosis, *, upset: bool) -> str:
    """What to do with a change that can be made."""
    if fix.by_hand and not helps(fix.odds, diagnosis.odds_as_driven):
        return "leave it as driven, or choose other values"
    how = again(diagnosis.run, upset=upset)
    tried = how if how == AGAIN else f"{how} first"
    return f"make the change, {tried}, and check what it brought with 'care verify REPORT LOG'"


def _named(diagnosis: Diagnosis) -> tuple[str, ...]:
    """What to look at: the part or circumstance that is likeliest, and the part that is mended before anything else."""
    part = mend_first(diagnosis.health.findings)
    first = first_named(diagnosis.hypotheses)
    leading = first if first is not None and first.what in ("hardware", "world") else None
    if part is None:
        return (leading.name,) if leading is not None else ()
    if leading is None or leading.name == part.title or not _leads(leading):
        return (part.title,)
    return leading.name, part.title


def _leads(first: Hypothesis) -> bool:
    """Whether a part or circumstance is likely enough to be looked at before any other."""
    return first.what in ("hardware", "world") and first.probability > LIKELY


def _undone(diagnosis: Diagnosis) -> str:
    """What can be put right at once, empty where nothing is said to be that."""
    findings = diagnosis.health.findings
    part, first = mend_first(findings), next(iter(diagnosis.hypotheses), None)
    leading = first_named(diagnosis.hypotheses)
    named = leading if leading is not None and leading.what == "parameter" else None
    if part is not None and (is_pack(part) or named is None or named.probability <= LIKELY):
        return CHARGE if is_pack(part) and not _is_aside(part, first, diagnosis.hypotheses) else ""
    if first is not None and first.name == OUTLASTED:
        return LAND_EARLIER
    refused = next((one for one in findings if one.kind == "prearm" and one.severity == "critical"), None)
    if refused is not None and not refused.parameters:
        return CLEAR_REFUSAL.format(why=refused.title.removeprefix(REFUSED))
    if named is not None and _is_kept(named.name, diagnosis):
        return f"let {named.name} change as well: without it nothing is likely enough"
    return "" if named is None else _set_right(named.name, diagnosis)


def _is_aside(part: Finding, first: Hypothesis | None, hypotheses: Sequence[Hypothesis]) -> bool:
    """Whether another part or circumstance leads so far that a pack which failed is only to be put right beside it."""
    if first is None or not _leads(first) or first.name == part.title:
        return False
    own = max((one.probability for one in hypotheses if one.name == part.title), default=0.0)
    return part.severity != "critical" or first.probability > _FAR_AHEAD * own


def _set_right(name: str, diagnosis: Diagnosis) -> str:
    """What to do with a parameter that leads and whose change is not advised; empty where its profile knows no more."""
    run, findings = diagnosis.run, diagnosis.health.findings
    said = next((one for one in findings if _says(one, name)), None)
    if said is not None and not _protects(name, run):
        return _as_built(name, said, run) or _put_right(_put_back_with(name, said, findings), findings, run)
    return _looked_at(name, diagnosis) if name not in run.config or _protects(name, run) else ""


def _protects(name: str, run: Run) -> bool:
    """Whether a parameter is a protection: nobody is told to make one looser."""
    meaning = meaning_of(name, vehicle_of_run(run).kind)
    return meaning is not None and meaning.role == "safety"


def _as_built(name: str, said: Finding, run: Run) -> str:
    """What to do with a parameter that says how the vehicle is built, where a refusal knows no more than its default;
    empty for any other."""
    meaning, setting = meaning_of(name, vehicle_of_run(run).kind), run.settings.get(name)
    if said.kind != "prearm" or meaning is None or meaning.part != BUILT_AS or setting is None:
        return ""
    if setting.default != dict(said.wanted).get(name):
        return ""
    how = f"it is {shown(setting.value)}, and the default is {shown(setting.default)}"
    return f"set {name} to how this vehicle is built: {how}"


def _put_right(names: Sequence[str], findings: Iterable[Finding], run: Run) -> str:
    """What these parameters are set to, where findings say it of each."""
    wanted = {name: value for one in findings for name, value in one.wanted}
    if _is_robot(run) or not wanted.keys() >= set(names):
        return f"put {listed(names)} back as the findings say"
    values = [f"{name} to {shown(wanted[name])}" for name in names]
    commands = ", ".join(f"'param set {name} {shown(wanted[name])}'" for name in names)
    return f"set {listed(values)} ({commands})"


def _is_kept(name: str, diagnosis: Diagnosis) -> bool:
    """Whether the operator wants a parameter to stay, and for that nothing is advised."""
    _, _, kept = (diagnosis.abstained or "").removesuffix(KEPT).rpartition(", with ")
    return (diagnosis.abstained or "").endswith(KEPT) and name in kept.split(", ")


def _says(finding: Finding, parameter: str) -> bool:
    """Whether a finding says what a parameter should be."""
    return finding.title.startswith(parameter) or any(name == parameter for name, _ in finding.wanted)


def _put_back_with(name: str, said: Finding, findings: Iterable[Finding]) -> list[str]:
    """The parameter and those that critical findings of the same kind name with it: of two motors that were switched
    off both are switched on again."""
    alike = (one for one in findings if one.kind == said.kind and one.severity == "critical" and not one.after_impact)
    return list(dict.fromkeys((name, *(other for one in alike for other in one.parameters))))


def _is_spoken_of(name: str, diagnosis: Diagnosis) -> bool:
    return any(name in one.parameters for one in every_finding(diagnosis.health.findings))


def _looked_at(name: str, diagnosis: Diagnosis) -> str:
    """What to do with a parameter outside the profile that leads and whose change is not advised."""
    refused = (one for one in diagnosis.health.findings if one.kind == "prearm" and name in one.parameters)
    said = [text for one in refused for text in one.evidence.split("; ") if text.startswith(f"{name} is ")]
    if said:
        return said[-1]  # what the check asks for, behind what the firmware says
    setting = diagnosis.run.settings.get(name)
    value = "" if setting is None else f" {shown(setting.value)}"
    meaning = meaning_of(name, vehicle_of_run(diagnosis.run).kind)
    if meaning is not None and meaning.role == "calibration" and _is_spoken_of(name, diagnosis):
        return f"{way_back(name, meaning.role, None)}: {name} is{value}"
    suspect = next((one for one in diagnosis.outside if one.name == name), None)
    is_set_by_hand = suspect is not None and suspect.role in SET_BY_HAND
    back = f"; {way_back(name, suspect.role, suspect.back)}" if suspect is not None and is_set_by_hand else ""
    robot = "robot" if _is_robot(diagnosis.run) else "vehicle"
    return f"check whether {name}{value} is right for this {robot}{back}"
