"""What is known of an option's parameter, each with its source: the log first, then the tables, then the profile."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from care_core.configs.driven import readable
from care_core.ecosystems.vehicles import vehicle_of
from care_core.metadata import navigation
from care_core.metadata.fact import Fact
from care_core.metadata.firmware import fact_of
from care_core.run import Setting, shown
from care_core.variables import Variable


class Known(NamedTuple):
    """One thing that is known, and who says so."""

    what: str
    text: str
    source: str


def known_of(option: Variable, settings: Mapping[str, Setting], facts: Mapping[str, str]) -> tuple[Known, ...]:
    """Type, range, default, unit, restart and one line for an option, as far as anything says.

    Args:
        settings: as driven: a log may describe its parameters.
        facts: what the log says of its robot, the vehicle and its release or distribution among it.
    """
    parameter = next(iter(readable(option)), option.name)
    return tuple(_lines(option, settings.get(parameter), _fact(parameter, settings, facts)))


def _lines(option: Variable, setting: Setting | None, fact: Fact | None) -> Iterator[Known]:
    source = "" if fact is None else fact.source
    line = option.doc or ("" if fact is None else fact.line)
    if line:
        yield Known("What", line, "profile" if option.doc else "")
    yield Known("Parameter", ", ".join(option.parameters) or option.name, "")
    yield Known("Type", option.type, "profile")
    unit = option.unit or ("" if fact is None else fact.unit)
    if unit:
        yield Known("Unit", unit, "profile" if option.unit else source)
    if setting is not None and (setting.low is not None or setting.high is not None):
        yield Known("Range", _span(setting.low, setting.high), "the log's own description")
    if fact is not None and (fact.low is not None or fact.high is not None):
        yield Known("Range", _span(fact.low, fact.high), source)
    elif fact is not None and fact.values:
        listed = ", ".join(f"{code:g} {label}".strip() for code, label in fact.values[:20])
        yield Known("Values", listed, source)
    if option.labels or option.range is not None:
        yield Known("Acceptable", option.acceptable, "profile: what may be suggested")
    if setting is not None and setting.default is not None:
        yield Known("Default", shown(setting.default), "the log")
    elif fact is not None and fact.default:
        yield Known("Default", fact.default, source)
    if option.default is not None:
        yield Known("Reference", option.show(option.default), "profile")
    needs = option.reboot_required or (fact is not None and fact.reboot)
    yield Known(
        "Restart", "needed" if needs else "not known to be needed", "profile" if option.reboot_required else source
    )


def _span(low: float | None, high: float | None) -> str:
    return f"{'any' if low is None else f'{low:g}'} to {'any' if high is None else f'{high:g}'}"


def _fact(parameter: str, settings: Mapping[str, Setting], facts: Mapping[str, str]) -> Fact | None:
    """What the tables say, for the distribution or the release that the log names."""
    if parameter.startswith("/"):
        ros: navigation.Ros = "ros2" if "." in parameter else "ros1"
        return navigation.fact_of(ros, parameter, facts.get("distro", ""))
    vehicle = vehicle_of(facts, settings)
    return fact_of(parameter, vehicle.kind, vehicle.version)
