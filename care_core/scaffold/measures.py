"""What of a robot's logs can be measured and judged: extractors are tried on the logs, those that answer are kept."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from care_core.ecosystems.measures import EXTRACTORS, MISSION_KINDS
from care_core.ecosystems.registry import register_measures, run_model
from care_core.ecosystems.vehicles import vehicle_of
from care_core.errors import CareError
from care_core.extract.read import read_runs
from care_core.profile.schema import Schema
from care_core.records import Record, Struct, field, replace
from care_core.run import Run, Unavailable, is_known
from care_core.scaffold.inputs import InputLog
from care_core.variables import Extract, Role, Variable

_NUMBERS = ("Float32", "Float64", "Int8", "Int16", "Int32", "Int64", "UInt8", "UInt16", "UInt32", "UInt64")
_SIGNALS: Mapping[str, tuple[tuple[str, str, Role, str], ...]] = {
    **dict.fromkeys(_NUMBERS, (("data", "mean", Role.METRIC, ""), ("data", "max", Role.METRIC, ""))),
    "Bool": (("data", "max", Role.METRIC, ""),),
    "Imu": (("linear_acceleration.z", "std", Role.METRIC, "m/s^2"),
            ("angular_velocity.z", "std", Role.METRIC, "rad/s")),
    "Range": (("range", "min", Role.METRIC, "m"),),
    "Temperature": (("temperature", "max", Role.CONTEXT, "degC"),),
    "BatteryState": (("voltage", "first", Role.CONTEXT, "V"), ("voltage", "min", Role.METRIC, "V")),
    "Odometry": (("twist.twist.linear.x", "mean", Role.METRIC, "m/s"),
                 ("twist.twist.linear.x", "max", Role.METRIC, "m/s"),
                 ("twist.twist.angular.z", "rms", Role.METRIC, "rad/s")),
    "Twist": (("linear.x", "mean", Role.METRIC, "m/s"), ("angular.z", "rms", Role.METRIC, "rad/s")),
    # uORB topics of PX4
    "battery_status": (("voltage_v", "first", Role.CONTEXT, "V"), ("voltage_v", "min", Role.METRIC, "V"),
                       ("current_a", "mean", Role.METRIC, "A")),
    "vehicle_gps_position": (("eph", "mean", Role.CONTEXT, "m"),),
    "vehicle_local_position": (("vx", "rms", Role.METRIC, "m/s"), ("vy", "rms", Role.METRIC, "m/s"),
                               ("z", "min", Role.METRIC, "m")),
    "vehicle_angular_velocity": (("xyz[0]", "rms", Role.METRIC, "rad/s"), ("xyz[1]", "rms", Role.METRIC, "rad/s"),
                                 ("xyz[2]", "rms", Role.METRIC, "rad/s")),
    "vehicle_thrust_setpoint": (("xyz[2]", "mean", Role.METRIC, ""),),
    "rate_ctrl_status": (("rollspeed_integ", "rms", Role.METRIC, ""), ("pitchspeed_integ", "rms", Role.METRIC, "")),
    "vehicle_imu_status": (("accel_vibration_metric", "mean", Role.METRIC, "m/s^2"),),
    "estimator_innovation_test_ratios": (("gps_hvel[0]", "mean", Role.METRIC, ""),
                                         ("gps_hpos[0]", "mean", Role.METRIC, "")),
    "hover_thrust_estimate": (("hover_thrust", "mean", Role.METRIC, ""),),
    "cpuload": (("load", "mean", Role.METRIC, ""),),
}  # fmt: skip
"""By the type of a channel: field, statistic, role, unit."""
_MOST_SIGNALS = 40
_WHY_SHORT = 90


class Measure(Record):
    """A variable whose extractor answers, with a value a run (None where it does not), in the order of the runs."""

    variable: Variable
    values: tuple[float | None, ...]

    @property
    def known(self) -> tuple[float, ...]:
        return tuple(value for value in self.values if value is not None)


class Measures(Struct, eq=False):
    """What the logs give, what they do not, and the runs they were tried on."""

    kept: list[Measure] = field(default_factory=list)
    left: dict[str, str] = field(default_factory=dict)
    """Name -> why no run has a value."""
    runs: list[tuple[InputLog, Run]] = field(default_factory=list)
    without: dict[str, str] = field(default_factory=dict)
    """Logs that gave no run, and why."""

    def of(self, role: Role) -> list[Measure]:
        return [one for one in self.kept if one.variable.role is role]


def find_measures(logs: Sequence[InputLog], spec: Mapping[str, Any], bundled: Sequence[Schema]) -> Measures:
    """Try on the logs what the bundled profiles of the same kind of mission measure, and signals of their channels."""
    register_measures()
    vehicle = vehicle_of(logs[0].opened.facts, logs[0].settings).kind
    candidates = [*_bundled_measures(str(spec["kind"]), vehicle, bundled), *_objectives_of(str(spec["kind"]))]
    types = {name: kind for log in logs for name, kind in log.channels.items()}
    named = set(MISSION_KINDS[str(spec["kind"])].needs(spec)) if spec["kind"] != "recording" else set()
    candidates += _signals(types, named, {one.name for one in candidates})
    formats = tuple(dict.fromkeys(log.opened.format.name for log in logs))
    variables = {variable.name: variable for variable in candidates}
    trial = Schema("trial", "", "", "", {}, formats, False, {**spec}, (), variables)
    found = Measures()
    for log in logs:
        try:
            found.runs += [(log, run) for run in read_runs(run_model(log.opened), trial, sha256=_unread)]
        except CareError as err:
            found.without[str(log.path)] = err.message
    for variable in candidates:
        _sort_in(found, variable)
    return found


def _unread() -> str:
    """In place of a log's digest, which a trial does not need."""
    return ""


def _sort_in(found: Measures, variable: Variable) -> None:
    answers = [run.value(variable.name) for _, run in found.runs]
    values = tuple(answer if is_known(answer) else None for answer in answers)
    if any(value is not None for value in values):
        found.kept.append(Measure(variable, values))
        return
    why = next((answer.reason for answer in answers if isinstance(answer, Unavailable)), "no log holds a mission")
    found.left[variable.name] = why[:_WHY_SHORT]


def _bundled_measures(kind: str, vehicle: str, bundled: Sequence[Schema]) -> list[Variable]:
    """Contexts, metrics and objectives of profiles of this kind of mission, each once: first of the same vehicle, then
    of the largest profile. That a whole recording is the mission says nothing of the robot: then none."""
    if kind == "recording":
        return []
    family = type(MISSION_KINDS[kind])
    schemas = [one for one in bundled if type(MISSION_KINDS.get(str(one.mission.get("kind")))) is family]
    schemas.sort(
        key=lambda one: (one.mission.get("kind") != kind, one.match.get("vehicle") != vehicle, -len(one.variables))
    )
    found: dict[str, Variable] = {}
    for schema in schemas:
        for variable in schema.variables.values():
            if variable.role is Role.OPTION or variable.extract is None or variable.name in found:
                continue
            if not any(_is_same(variable.extract, one.extract) for one in found.values()):
                # What an objective is said to be there belongs to the mission of that profile.
                is_judged = variable.role is Role.OBJECTIVE
                doc = EXTRACTORS[variable.extract.kind].doc.partition(".")[0] if is_judged else variable.doc
                found[variable.name] = replace(variable, nominal=None, doc=doc)
    return list(found.values())


def _is_same(a: Extract | None, b: Extract | None) -> bool:
    return a is not None and b is not None and (a.kind, dict(a.args)) == (b.kind, dict(b.args))


def _objectives_of(kind: str) -> Iterator[Variable]:
    """What any recording can be judged by, where the kind of mission brings no objectives of its own."""
    if kind != "recording":
        return
    yield Variable(
        "mission_time", Role.OBJECTIVE, unit="s", doc="length of the mission", kind="non-functional",
        extract=Extract("recorded_time"), order=1,
    )  # fmt: skip


def _signals(types: Mapping[str, str], named: set[str], taken: Iterable[str]) -> list[Variable]:
    """A variable for each number that channels of known types carry, but for those the mission's extractors read."""
    used, found = set(taken), list[Variable]()
    for channel, kind in sorted(types.items()):
        if channel in named:
            continue
        for path, stat, role, unit in _SIGNALS.get(kind.rpartition("/")[2], ()):
            name = _name(channel, path, stat)
            if name not in used and len(found) < _MOST_SIGNALS:
                used.add(name)
                extract = Extract("signal", {"channel": channel, "field": path, "stat": stat})
                doc = f"{stat} of {path} on {channel}"
                found.append(Variable(name, role, unit=unit, doc=doc, extract=extract))
    return found


def _name(channel: str, path: str, stat: str) -> str:
    parts = (channel, "" if path == "data" else path, stat)
    return "_".join(part for part in (re.sub(r"\W+", "_", part).strip("_") for part in parts) if part)
