"""What a page draws of a case: the signals behind the metrics and findings of a run, thinned so that spikes stay."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from care_core.application.open_run import OpenRun
from care_core.application.proof import finding_score, meanings
from care_core.application.responses import responses_of
from care_core.application.sharing import EVERYTHING, Sharing
from care_core.application.signals import LONGEST_GAP, Signal, Source, settled_s, shown_lines, signals_of, whole_of
from care_core.application.signals import Line as Values
from care_core.numbers import Floats, median
from care_core.records import replace
from care_core.report.marks import Mark, marks_of
from care_core.report.plots import Band, Drawing, Limit, Line, Plot, Point

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from care_core.ecosystems.findings import Finding

MOST_PLOTS, FEWEST, MOST_OTHERS = 8, 6, 10
"""Plots that matter at most and, with others, at least; and how many more."""
MOST_POINTS = 400
"""Points of a line."""
MOST_MARKS = 16
_SAME = 12
"""Letters that two marks of one second share where they say the same."""
_LEAST_GAP = 0.01
"""Share of the span for which a line must have no value as well, to be broken."""

_TOGETHER = {
    "RCOU": "",
    "MOT": "",
    "SERVO_OUTPUT_RAW": "",
    "VIBE": "",
    "VIBRATION": "",
    "MAG": "magnetic field",
    "XKF4": "test ratios of the estimator",
    "NKF4": "test ratios of the estimator",
}
"""Records whose fields are drawn in one plot, with words for them all where those of the first are not."""
MOST_TOGETHER = 8

_PARAMETER_LIMITS: Mapping[Source, tuple[tuple[str, float], ...]] = {
    ("BAT", "Volt"): (("BATT_LOW_VOLT", 1.0), ("BATT_CRT_VOLT", 1.0)),
    ("ATT", "Roll"): (("ANGLE_MAX", 0.01),),
    ("ATT", "Pitch"): (("ANGLE_MAX", 0.01),),
    ("GPS", "HDop"): (("GPS_HDOP_GOOD", 0.01),),
    ("RCOU", "C1"): (("MOT_PWM_MAX", 1.0), ("MOT_PWM_MIN", 1.0)),
}
"""Parameters that are a limit of a signal, and the factor to its unit; 0 switches such a limit off."""
_COUNTERS: Mapping[Source, str] = {("BAT", "EnrgTot"): "energy"}
"""Counters that an objective is the growth of."""


def drawn_of(case: OpenRun, sharing: Sharing = EVERYTHING) -> Drawing:
    """What there is to draw of a case, as far as it goes to others."""
    diagnosis = case.diagnosis
    if case.log is None:
        return Drawing(faults=diagnosis.faults, responses=responses_of(case))
    span = whole_of(case)
    groups, telling = ranked(case, sharing)
    first = max(min(telling, MOST_PLOTS), FEWEST)
    chosen = [(group, place < first) for place, group in enumerate(groups[: first + MOST_OTHERS])]
    sources = [source for group, _ in chosen for source in sources_of(group)]
    values = shown_lines(case, sources, span)
    plots = [_plot(case, group, values, span, matters=matters) for group, matters in chosen]
    text = sharing.text(case)
    return Drawing(
        faults=diagnosis.faults,
        plots=tuple(replace(plot, source=text(plot.source), lines=_named(plot.lines, text)) for plot in plots if plot),
        marks=marks_in(case, span),
        responses=responses_of(case),
        deadlines=tuple(_deadlines(case, span)),
        start_s=span[0],
        end_s=span[1],
        scale_end_s=settled_s(diagnosis),
    )


def sources_of(group: Sequence[Signal]) -> list[Source]:
    """The channels and fields of signals, and of what they were to follow."""
    return [source for one in group for source in ((one.channel, one.field), one.wanted) if source]


def _named(lines: Sequence[Line], text: Callable[[str], str]) -> tuple[Line, ...]:
    return tuple(replace(line, name=text(line.name)) for line in lines)


def _groups(signals: Sequence[Signal]) -> list[list[Signal]]:
    """Signals that share a plot, in the order of their first."""
    groups: dict[Source, list[Signal]] = {}
    for one in signals:
        key = one.channel, "" if one.channel in _TOGETHER and one.wanted is None else one.field
        groups.setdefault(key, []).append(one)
    return [group[:MOST_TOGETHER] for group in groups.values()]


def ranked(case: OpenRun, sharing: Sharing = EVERYTHING) -> tuple[list[list[Signal]], int]:
    """The signals of a case that share a plot, those first that a finding, a fault or a causal path speaks of, and how
    many groups that are; as far as they go to others."""
    diagnosis = case.diagnosis
    matters = {result.variable.name for result in diagnosis.objectives if result.status == "fault"}
    matters |= {node.name for fault in diagnosis.faults for cause in fault.causes[:1] for node in cause.path}
    findings = [one for one in diagnosis.health.findings if one.severity != "info"]
    findings += [below for one in findings for below in one.below]
    meaning = meanings(case)

    def rank(group: Sequence[Signal]) -> tuple[float, float]:
        fields = [(one, meaning(one.channel, one.field)) for one in group]
        for place, finding in enumerate(findings):
            score = max(finding_score(finding, one, field) for one, field in fields)
            if score >= 1:
                return 0.0, place - score / 100
        used = {name for one in group for name in one.used_by}
        if used & matters:
            return 1.0, -len(used & matters) / len(used)
        return (2.0, 0.0) if group[0].wanted else (3.0, 0.0)

    groups = list(_groups(signals_of(case)))
    if not sharing.positions:
        groups = [group for group in groups if not any(meaning(one.channel, one.field).is_position for one in group)]
    ordered = sorted(groups, key=rank)
    return ordered, sum(rank(group)[0] < 2 for group in ordered)


def _channels(finding: Finding) -> list[str]:
    """The words of a finding's source, channels among them."""
    return re.findall(r"/[\w/]+|\w+", finding.source)


def _plot(
    case: OpenRun,
    group: Sequence[Signal],
    values: Mapping[Source, Values | None],
    span: tuple[float, float],
    *,
    matters: bool,
) -> Plot | None:
    """The plot of a group, None where the log has no number for it in the span."""
    channel = group[0].channel
    meaning = meanings(case)(channel, group[0].field)
    unit, words = meaning.unit, meaning.label
    lines, drawn = [], []
    for one in group:
        found = values.get((one.channel, one.field))
        if found is None or not len(found[1]) or (len(group) > 1 and not found[1].any()):
            continue
        drawn.append(one.field)
        wrap = {"deg": 360.0, "rad": 6.2832}.get(unit) if words == "heading" else None
        lines.append(Line(one.field, segments(*found, span, wrap)))
        wanted = values.get(one.wanted) if one.wanted else None
        if wanted is not None and len(wanted[1]):
            lines.append(Line(one.wanted_name, segments(*wanted, span, wrap), is_wanted=True))
    if not lines:
        return None
    findings = [one for found in case.diagnosis.health.findings for one in (found, *found.below)]
    return Plot(
        words=_TOGETHER.get(channel, "") or words,
        source=f"{channel} {', '.join(drawn)}",
        unit=unit,
        read_for=tuple(dict.fromkeys(name for one in group for name in one.used_by))[:6],
        lines=tuple(lines),
        limits=tuple(_limits(case, group, values)),
        bands=tuple(_bands(findings, channel, span)),
        matters=matters,
    )


def segments(t: Floats, values: Floats, span: tuple[float, float], wrap: float | None) -> tuple[tuple[Point, ...], ...]:
    """A line as few points in pieces; angles that turn over at `wrap` are broken there."""
    import numpy as np

    if np.any(np.diff(t) < 0):
        order = np.argsort(t, kind="stable")
        t, values = t[order], values[order]
    steps = np.diff(t)
    longest = max(LONGEST_GAP * float(median(steps)) if len(steps) else 0.0, _LEAST_GAP * (span[1] - span[0]))
    is_end = steps > longest
    if wrap is not None:
        is_end |= np.abs(np.diff(values)) > wrap / 2
    piece = np.concatenate(([0], np.cumsum(is_end)))
    kept = thinned(t, values, span, MOST_POINTS)
    pieces = np.split(kept, np.flatnonzero(np.diff(piece[kept])) + 1)
    return tuple(tuple((float(t[i]), float(values[i])) for i in one) for one in pieces if len(one))


def thinned(t: Floats, values: Floats, span: tuple[float, float], most: int) -> NDArray[np.intp]:
    """Places of at most so many values that show what all would: the least and the greatest of each part of the span,
    the first and the last. Shape (k,), in order of time."""
    import numpy as np

    if len(t) <= most:
        return np.arange(len(t))
    edges = np.linspace(*span, most // 2)
    starts = np.unique(np.clip(np.searchsorted(t, edges), 0, len(t) - 1))
    ends = np.append(starts[1:], len(t))
    least = [start + int(np.argmin(values[start:end])) for start, end in zip(starts, ends, strict=True)]
    greatest = [start + int(np.argmax(values[start:end])) for start, end in zip(starts, ends, strict=True)]
    return np.unique(np.array([0, *least, *greatest, len(t) - 1]))


def _limits(case: OpenRun, group: Sequence[Signal], values: Mapping[Source, Values | None]) -> Iterator[Limit]:
    """What the signals of a plot were to keep: documented limits, parameters as driven, limits of objectives."""
    settings, known = case.diagnosis.run.settings, _limits_of_checks()
    for one in group:
        source = one.channel, one.field
        yield from known.get(source, ())
        for name, factor in _PARAMETER_LIMITS.get(source, ()):
            setting = settings.get(name)
            if setting is not None and isinstance(setting.value, float) and setting.value > 0:
                yield Limit(setting.value * factor, name)
        found = values.get(source)
        for result in case.diagnosis.objectives:
            if result.name == _COUNTERS.get(source) and result.threshold is not None and found is not None:
                yield Limit(float(found[1][0]) + result.threshold.bound, f"limit of {result.name}")


def _limits_of_checks() -> Mapping[Source, tuple[Limit, ...]]:
    """What the health checks hold against a signal that is drawn."""
    from care_core.ecosystems.ardupilot.checks import estimator, vibration

    shaken = Limit(vibration.HIGH, "acceptable below"), Limit(vibration.SEVERE, "trouble nearly always above")
    rejected = (Limit(estimator.RATIO, "rejected above"),)
    return {
        ("VIBE", "VibeX"): shaken,
        ("VIBRATION", "vibration_x"): shaken,
        ("XKF4", "SV"): rejected,
        ("NKF4", "SV"): rejected,
    }


def _bands(findings: Collection[Finding], channel: str, span: tuple[float, float]) -> Iterator[Band]:
    """The times of findings that this channel shows."""
    for one in findings:
        named = one.severity != "info" and channel in _channels(one)
        if named and one.end_s > one.onset_s and one.onset_s < span[1] and one.end_s > span[0]:
            yield Band(one.onset_s, one.end_s, one.severity, one.title)


def marks_in(case: OpenRun, span: tuple[float, float], most: int = MOST_MARKS) -> tuple[Mark, ...]:
    """The gravest of what happened in the span, in order of time; what two sources say at one time once."""
    inside = {
        (round(mark.time_s), mark.words.casefold()[:_SAME]): mark
        for mark in sorted(marks_of(case.diagnosis), key=lambda mark: -mark.rank)
        if span[0] <= mark.time_s <= span[1]
    }
    gravest = sorted(inside.values(), key=lambda mark: (mark.rank, mark.time_s))[:most]
    return tuple(sorted(gravest, key=lambda mark: mark.time_s))


def _deadlines(case: OpenRun, span: tuple[float, float]) -> Iterator[Limit]:
    """Limits of objectives that are the time of the mission itself, as times of the log."""
    for result in case.diagnosis.objectives:
        is_time = result.variable.unit == "s" and result.threshold is not None and result.value is not None
        if (
            is_time
            and result.threshold
            and abs((result.value or 0.0) - (span[1] - span[0])) < 0.02 * (span[1] - span[0])
        ):
            yield Limit(span[0] + result.threshold.bound, f"limit of {result.name}")
