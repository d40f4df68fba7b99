"""Two logs opened, judged alike and put side by side, with the signals of both."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from care_core.application.case import Case, Request, open_case
from care_core.application.open_run import OpenRun, log_of
from care_core.application.plotting import MOST_PLOTS, marks_in, ranked, segments
from care_core.application.proof import meanings
from care_core.application.sharing import EVERYTHING, Sharing
from care_core.application.signals import Line as Values
from care_core.application.signals import Signal, Source, shown_lines, whole_of
from care_core.errors import UsageError, nearest
from care_core.progress import Progress
from care_core.records import Record, replace
from care_core.report.plots import Drawing, Line, Plot

if TYPE_CHECKING:
    from care_core.diagnose.comparison import Comparison, Departure
    from care_core.numbers import Floats
    from care_core.report.comparison import CompareDocument

FORMATS = {"text": (), "json": (".json",), "markdown": (".md",), "html": (".html", ".htm")}
"""Formats of a comparison, and the endings of files that hold them."""
_SENT = ("markdown", "html")
MOST_DEPARTURES = 6
MOST_OTHERS = 6
"""Plots beyond those that matter."""
_MARKS_EACH = 8
_OF_SENSORS = ("VIBE", "VIBRATION", "XKF", "NKF", "MAG", "RCOU", "SERVO_OUTPUT_RAW", "MOT", "BAT", "/battery")
"""Begin channels of how sensors and motors did it, not of what the vehicle did: noise parts them first."""
_STEP_S = 0.2
_APART = 1 / 3
"""Signals go apart where they differ by this share of what the signals of their channel range over (5 to 95%), ..."""
_FOR_S = 2.0
"""... for so long, each averaged over as long, after they were together."""
_LEAST_APART = {"deg": 2.0, "deg/s": 3.0, "m": 0.2, "m/s": 0.1, "m/s2": 0.2, "rad": 0.03, "rad/s": 0.05}
"""What apart is at least, by unit: less is noise of sensors and of the ground."""
_LEAST_S = 5.0
"""Runs that overlap for less are not compared by their signals."""


class Compared(Record, eq=False):
    """Two open runs, `a` the one to compare with."""

    a: Case
    b: Case
    sharing: Sharing = EVERYTHING
    """What of the runs goes into a report."""

    def comparison(self) -> Comparison:
        """Both runs side by side, as far as it goes to others."""
        from care_core.diagnose.comparison import compare_runs

        one, other = self.sharing.of(self.a), self.sharing.of(self.b)
        same = self.a.diagnosis.profile.name == self.b.diagnosis.profile.name
        schema, model = self.b.schema if same else None, self.b.model if same else None
        variables = () if schema is None else tuple(schema.variables.values())
        summaries = None if model is None else model.summaries
        return compare_runs(one.diagnosis, other.diagnosis, variables, summaries, self._departures())

    def drawing(self) -> Drawing:
        """The signals of both over each other, from the start of each run's mission."""
        spans = [whole_of(case) for case in (self.a, self.b)]
        end_s = max(end_s - start_s for start_s, end_s in spans)
        marks = [
            replace(mark, time_s=mark.time_s - span[0], words=f"{name}: {mark.words}")
            for name, case, span in zip("AB", (self.a, self.b), spans, strict=True)
            for mark in marks_in(self.sharing.of(case), span, _MARKS_EACH)
        ]
        is_mission = any(case.diagnosis.run.mission.count for case in (self.a, self.b))
        return Drawing(
            plots=tuple(self._plots(end_s)),
            marks=tuple(sorted(marks, key=lambda mark: mark.time_s)),
            end_s=end_s,
            since=f"the start of each {'mission' if is_mission else 'log'}",
        )

    def _plots(self, end_s: float) -> Iterator[Plot]:
        text, meaning_of = self.sharing.text(self.b), meanings(self.b)
        for place, (signal, one, other) in enumerate(self._pairs()):
            if place >= MOST_PLOTS + MOST_OTHERS:
                return
            meaning = meaning_of(signal.channel, signal.field)
            wrap = {"deg": 360.0, "rad": 6.2832}.get(meaning.unit) if meaning.label == "heading" else None
            yield Plot(
                words=meaning.label,
                source=text(f"{signal.channel} {signal.field}"),
                unit=meaning.unit,
                read_for=signal.used_by[:6],
                lines=tuple(
                    Line(name, segments(*values, (0.0, end_s), wrap)) for name, values in (("A", one), ("B", other))
                ),
                matters=place < MOST_PLOTS,
            )

    def _pairs(self) -> Iterator[tuple[Signal, Values, Values]]:
        """The signals that both logs have, those first that matter to the diagnosis of B, in seconds from the start of
        the missions. Of signals that share a plot the one that differs most."""
        groups, _ = ranked(self.b, self.sharing)
        sources = [(signal.channel, signal.field) for group in groups for signal in group]
        one, other = (_from_start(case, sources) for case in (self.a, self.b))
        for group in groups:
            held = [
                (signal, one[key], other[key])
                for signal in group
                if (key := (signal.channel, signal.field)) in one and key in other
            ]
            if held:
                yield max(held, key=lambda pair: _distance(*pair[1:]))

    def _departures(self) -> Sequence[Departure]:
        """Where signals go apart first."""
        from care_core.diagnose.comparison import Departure

        text, meaning_of, found = self.sharing.text(self.b), meanings(self.b), []
        pairs = [
            (*pair, meaning)
            for pair in self._pairs()
            if not (meaning := meaning_of(pair[0].channel, pair[0].field)).is_position
            and meaning.label != "heading"  # its numbers turn over at north
            and not pair[0].channel.startswith(_OF_SENSORS)
        ]
        spans: dict[tuple[str, str], float] = {}
        for signal, one, other, meaning in pairs:  # sideways is little where the way ahead is long
            key = signal.channel, meaning.unit
            spans[key] = max(spans.get(key, 0.0), _range(one[1], other[1]))
        for signal, one, other, meaning in pairs:
            least = _LEAST_APART.get(meaning.unit, 1e-9)
            at = _departure(one, other, max(_APART * spans[signal.channel, meaning.unit], least))
            if at is not None:
                name = text(f"{meaning.label} ({signal.name})" if meaning.label else signal.name)
                found.append(Departure(name, *at, meaning.unit))
        return sorted(found, key=lambda one: one.time_s)[:MOST_DEPARTURES]

    def document(self) -> CompareDocument:
        """Both runs as `care.compare/1`."""
        from care_core.report.comparison import compare_document

        return compare_document(self.comparison())

    def report(self, format: str = "text", sharing: Sharing | None = None) -> str:
        """Both runs in a format: text, json, markdown or html; `sharing` is what of them goes into it, by default no
        positions into the last two, which are made to be sent. Raises UsageError where there is no such format."""
        from care_core.report.comparison import WRITERS

        if format not in FORMATS:
            hint = nearest(format, FORMATS) or f"There are {', '.join(FORMATS)}."
            raise UsageError(f"A comparison has no format '{format}'.", hint=hint)
        shared = replace(self, sharing=sharing or Sharing(positions=format not in _SENT))
        document = shared.document()
        if format in WRITERS:
            return WRITERS[format](document)
        from care_core.report.html import comparison_html

        return comparison_html(document, shared.drawing())


def compare(a: Request, b: Request, progress: Progress) -> Compared:
    """Open two logs and judge both by one profile: that of B, where it can judge A as well.

    Raises:
        CareError: one of the logs cannot be read, or the operator named what is not there.
    """
    other = open_case(b, lambda step, share: progress(f"B: {step}", 0.5 * share))
    one = replace(a, profile=b.profile or a.profile)
    return beside(one, other, lambda step, share: progress(f"A: {step}", 0.5 + 0.5 * share))


def beside(a: Request, other: Case, progress: Progress) -> Compared:
    """Open a log and put it beside an open run, judged by that one's profile where it can be. Raises CareError, also
    where it is the log of another kind of robot."""
    from care_core.diagnose.since import refuse_another_robot
    from care_core.logs.opening import open_log

    refuse_another_robot(open_log(a.log), log_of(other), "Name two runs of the same robot.")
    if a.profile is not None or other.reading is None:
        return Compared(open_case(a, progress), other)
    one = open_case(replace(a, profile=str(other.reading.profile.path)), progress)
    return Compared(open_case(a, progress) if one.reading is None else one, other)


def _from_start(case: OpenRun, sources: Sequence[Source]) -> Mapping[Source, Values]:
    """The numbers of signals during the mission, in seconds from its start; without those that the log lacks."""
    start_s, end_s = whole_of(case)
    found = shown_lines(case, sources, (start_s, end_s))
    return {source: (line[0] - start_s, line[1]) for source, line in found.items() if line is not None and len(line[1])}


def _grids(one: Values, other: Values) -> tuple[Floats, Floats, Floats] | None:
    """Both signals at the same times, as long as both last: times, values of the one and of the other, shape (n,)."""
    import numpy as np

    if min(len(one[0]), len(other[0])) < 2:
        return None
    first_s, last_s = max(one[0].min(), other[0].min()), min(one[0].max(), other[0].max())
    if last_s - first_s < _LEAST_S:
        return None
    times = np.arange(first_s, last_s, max(_STEP_S, (last_s - first_s) / 20_000))
    ordered = [np.argsort(line[0], kind="stable") for line in (one, other)]
    values = [
        np.interp(times, line[0][order], line[1][order]) for line, order in zip((one, other), ordered, strict=True)
    ]
    return times, values[0], values[1]


def _range(a: Floats, b: Floats) -> float:
    """What both range over, without the outermost values."""
    import numpy as np

    low, high = np.percentile(np.concatenate((a, b)), (5, 95))
    return float(high - low)


def _distance(one: Values, other: Values) -> float:
    """How different two signals are while both last, as a share of what they range over."""
    import numpy as np

    grids = _grids(one, other)
    if grids is None:
        return 0.0
    _, a, b = grids
    span = _range(a, b)
    return float(np.mean(np.abs(a - b)) / span) if span > 0 else 0.0


def _departure(one: Values, other: Values, most: float) -> tuple[float, float, float] | None:
    """When two signals that were together go apart by more than `most`, and what each reads then; None where they do
    not: what differs from the start on, as heights above another home do, tells of another place."""
    import numpy as np

    grids = _grids(one, other)
    if grids is None:
        return None
    times, a, b = grids
    steps = max(int(_FOR_S / (times[1] - times[0])), 1)
    if len(times) < 2 * steps:
        return None
    window = np.ones(steps)
    a, b = (np.convolve(line, window / steps, mode="valid") for line in (a, b))  # noise is no difference
    is_apart = np.abs(a - b) > most
    starts = np.flatnonzero(np.convolve(is_apart, window, mode="valid") >= steps)
    starts = starts[np.logical_or.accumulate(~is_apart)[starts]]
    if not len(starts):
        return None
    place = int(starts[0])
    return float(times[place]), float(a[place]), float(b[place])
