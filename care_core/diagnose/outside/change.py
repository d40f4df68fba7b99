"""What is advised of a parameter outside the profile: a change where the log or flights carry it, else a look first."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import cast, get_args

from care_core.diagnose.records import Fix, Hypothesis, OutsideSuspect, first_named
from care_core.ecosystems.findings import Finding, every_finding
from care_core.ecosystems.vehicles import vehicle_of_run
from care_core.ecosystems.vehicles.vehicle import Kind, Vehicle
from care_core.metadata.causal_map import BUILT_AS, FROM_FLIGHTS, meaning_of
from care_core.metadata.fact import Fact
from care_core.metadata.firmware import fact_of, is_code
from care_core.metadata.navigation import mended
from care_core.records import Record, replace
from care_core.run import Run, Setting, shown
from care_core.variables import Change, Role, ValueType, Variable

ENOUGH = 0.4
"""Probability of a parameter from which its change is advised: nothing else is then as likely by far."""


class Advisable(Record):
    """A parameter outside the profile that leads the ranking: its value, and the one that the log measures, or to which
    it goes back."""

    name: str
    value: float
    wanted: float | None
    """None where only that its value is wrong follows."""
    wanted_in_words: str
    """The same and whose value it is, empty where nothing says it."""
    probability: float
    why: str
    is_found: bool
    """Whether a finding of this run names it."""
    is_advised: bool
    """Whether the log itself, or flights with such a value, carry a change."""


def leading_outside(
    hypotheses: Sequence[Hypothesis], suspects: Sequence[OutsideSuspect], findings: Sequence[Finding], run: Run
) -> Advisable | None:
    """The parameter outside the profile that leads the ranking, None where another explanation does: one that is not
    named leads none.

    A change of it is advised where the log measures the value, or where flights with such a value were lost in this way
    and nothing but its operator's choice stands against the default. What protects is never put back by advice.
    """
    first = first_named(hypotheses)
    if first is None or first.what != "parameter" or first.name in run.config:
        return None
    setting, meaning = run.left_at(first.name), meaning_of(first.name, vehicle_of_run(run).kind)
    if setting is None or not isinstance(setting.value, (int, float)):
        return None
    suspect = next((one for one in suspects if one.name == first.name), None)
    finding = next((one for one in every_finding(findings) if first.name in one.parameters), None)
    if meaning is None and finding is None:  # nothing but a finding knows the parameters of a ROS robot
        return None
    measured = None if finding is None else dict(finding.wanted).get(first.name)
    wanted = suspect.back if measured is None and suspect is not None else measured
    in_words = "" if wanted is None else _in_words(wanted, suspect, setting)
    if finding is None and suspect is None:
        return None
    is_learned = suspect is not None and suspect.is_learned and meaning is not None and meaning.role in FROM_FLIGHTS
    is_carried = (measured is not None or is_learned) and not _is_kept(first.name, vehicle_of_run(run).kind)
    return Advisable(
        first.name,
        float(setting.value),
        wanted,
        in_words,
        first.probability,
        finding.title if finding is not None else suspect.text if suspect is not None else "",
        is_found=finding is not None,
        is_advised=is_carried and wanted not in (None, setting.value) and first.probability >= ENOUGH,
    )


def _in_words(wanted: float, suspect: OutsideSuspect | None, setting: Setting) -> str:
    """What a parameter should be, and whose value that is where the log does not measure it."""
    if suspect is not None and suspect.back == wanted:
        return suspect.back_in_words
    return f"{'default' if setting.default == wanted else 'should be'} {shown(wanted)}"


def outside_fix(one: Advisable, odds: float, run: Run, beside: Sequence[Change] = ()) -> Fix:
    """Its change as a fix, with those of the profile's options that are made with it. Raises ValueError where no value
    is wanted."""
    if one.wanted is None:
        raise ValueError(f"no value of {one.name} is known to be right")
    return Fix((_change(one.name, one.value, one.wanted, run), *beside), odds, {})


def asked_by_findings(findings: Sequence[Finding]) -> dict[str, float]:
    """The parameters that a refusal to arm, or anything as grave, names with the value that it asks for."""
    return {name: value for one in every_finding(findings) if one.severity == "critical" for name, value in one.wanted}


def asked_beside(findings: Sequence[Finding], run: Run, known: Collection[str]) -> tuple[Change, ...]:
    """The parameters besides the known ones that findings ask for, each at the value that they say. What protects, and
    how the vehicle is built, is left to its operator."""
    asked = {name: value for name, value in asked_by_findings(findings).items() if name not in known}
    kind = vehicle_of_run(run).kind
    left = {name: run.left_at(name) for name in asked if not _is_kept(name, kind)}
    return tuple(
        _change(name, float(setting.value), asked[name], run)
        for name, setting in left.items()
        if setting is not None and isinstance(setting.value, (int, float)) and setting.value != asked[name]
    )


def _change(name: str, value: float, wanted: float, run: Run) -> Change:
    option = outside_option(name, wanted, vehicle_of_run(run))
    again = "a reboot" if mended(name) is None else "a restart"
    notes = (option.told_of(wanted), f"takes effect after {again}" if option.reboot_required else "")
    return Change(option, value, wanted, tuple(filter(None, notes)))


def _is_kept(name: str, kind: Kind) -> bool:
    """Whether only its operator puts it back: what protects, how a vehicle is built, and what no map knows."""
    meaning = meaning_of(name, kind)
    return not mended(name) if meaning is None else meaning.role == "safety" or meaning.part == BUILT_AS


def shown_fix(lead: Advisable | None, run: Run, findings: Sequence[Finding]) -> Fix | None:
    """The change that the log itself shows, where no objective could be judged and nothing has odds, with what else was
    set wrong in the same way; None where it shows none."""
    if lead is None or not lead.is_advised or not lead.is_found:
        return None
    kind = next(one.kind for one in every_finding(findings) if lead.name in one.parameters)
    alike = [one for one in every_finding(findings) if one.kind == kind and not one.after_impact]
    fix = outside_fix(lead, lead.probability, run, asked_beside(alike, run, {lead.name}))
    return replace(fix, shown_by=lead.why)


def outside_option(name: str, default: float | None, vehicle: Vehicle) -> Variable:
    """A parameter that no profile models, as an option: with what the firmware's documentation says of it."""
    fact = fact_of(name, vehicle.kind, vehicle.version)
    meaning, shown_by_logs = meaning_of(name, vehicle.kind), mended(name)
    return Variable(
        name=name,
        role=Role.OPTION,
        type=_type(name, fact),
        unit=fact.unit if fact is not None else shown_by_logs.unit if shown_by_logs is not None else "",
        doc="" if fact is None else fact.line,
        range=None if fact is None or fact.low is None or fact.high is None else (fact.low, fact.high),
        default=default,
        parameters=(name,),
        reboot_required=any((fact is not None and fact.reboot, shown_by_logs is not None and shown_by_logs.restart)),
        safety=meaning is not None and meaning.role == "safety",
    )


def _type(name: str, fact: Fact | None) -> ValueType:
    known = mended(name)
    if known is not None and known.type in get_args(ValueType):
        return cast(ValueType, known.type)
    return "int" if fact is not None and is_code(fact) else "float"


def check_first(one: Advisable) -> str:
    """What to look at where no change is advised."""
    if one.is_found and one.why.startswith(one.name):  # it was changed on the way: no single value was driven
        return f"what is found comes first: {one.why}"
    why = f": {one.why}" if one.why and not one.why.startswith(f"{one.name} {shown(one.value)}") else ""
    usual = f" ({one.wanted_in_words})" if one.wanted_in_words else ""
    return f"check first {one.name} {shown(one.value)}{usual}{why}"
