"""Motors that are kept from their thrust, a throttle that swings, a hover throttle that is not the vehicle's.

All that motors have is spent where the throttle stays high and the vehicle stays down.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.checks.settings.output_range import Kept, kept_from_range
from care_core.ecosystems.ardupilot.flight import BY_STICK, Flight
from care_core.ecosystems.ardupilot.statistics import lasting, smooth
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import Span, during
from care_core.logs.base import Wanted
from care_core.numbers import Floats, known_median, median

READS: Wanted = {"CTUN": ("ThO", "Alt"), "RCOU": tuple(f"C{n}" for n in range(1, 9))}

LIMITS = Limits()
_SPENT = LIMITS.add("throttle that lifts any vehicle", 0.6875, "", "AP_MotorsMulticopter.h: AP_MOTORS_THST_HOVER_MAX")
_GROUNDED_S = LIMITS.add("such a throttle on the ground", 10.0, "s", "a choice: a take-off takes less")
_KEPT = LIMITS.add("range of the outputs that is left", 0.9, "", "a choice: a share of the range as shipped")
_REACHED = LIMITS.add("outputs that reach what is left of it", 0.05, "", "a choice: a share of the range as shipped")
_ALL = LIMITS.add(
    "output of the middle motor", 0.85, "", "a choice: a share of the highest; a weak motor leaves it 0.7"
)
_SWINGS = LIMITS.add(
    "throttle off its mean of three seconds",
    0.2,
    "",
    "305 healthy flights have 0.14 at most, in the median of the flight",
)
_RAISED = LIMITS.add(
    "times its default that a gain is raised", 1.5, "", "a choice: usual tuning changes a gain by less"
)
_HOVER = LIMITS.add("times MOT_THST_HOVER that hovering takes", 1.6, "", "a choice: loads and winds take less")
_EDGE_S, _FEWEST = 4.0, 20
_LIFTS = 0.1
"""Throttle, over three seconds, of a light vehicle in the air; on the ground it idles below it."""
_SURE_P = LIMITS.add(
    "probability that what ends the outputs keeps it down", 0.9, "", "both flights that stayed down so"
)
_TOO_LITTLE = LIMITS.add(
    "range of the outputs that surely keeps it down", 0.65, "", "the flights that stayed down so had 0.6 to 0.65"
)
_UNSURE = LIMITS.add("the same where nearly all is left", 0.2, "", "0.75 flew where no motor was weak")
_SWINGS_ALONE = LIMITS.add(
    "the same without a raised gain",
    0.15,
    "",
    "of 150 flights of strangers and simulators none that held has over 0.11",
)
_SWINGS_S = LIMITS.add("such swings without a raised gain", 15.0, "s", "a choice: a pilot that bounces is done sooner")
_SWINGS_P = LIMITS.add(
    "probability of a height control that swings", 0.8, "", "a choice: what it is fed may be the cause"
)
_GAIN_P = LIMITS.add("probability of a raised gain", 0.8, "", "a choice: no healthy flight swings so")
_FEEDS_P = LIMITS.add("probability of a hover throttle that is wrong", 0.9, "", "it is measured")
_FEEDS_LOST_P = LIMITS.add("probability that it costs the mission", 0.02, "", "0 of 4 flights at half and twice failed")
_GAINS = (
    "PSC_ACCZ_P", "PSC_ACCZ_I", "PSC_ACCZ_D", "PSC_ACCZ_FF", "PSC_ACCZ_D_FF", "PSC_VELZ_P", "PSC_VELZ_I", "PSC_VELZ_D",
    "PSC_POSZ_P",
)  # fmt: skip


def find(flight: Flight) -> Iterator[Finding]:
    """What is wrong with how the throttle becomes thrust."""
    if not flight.is_copter or flight.kind == "heli" or flight.throttle is None:
        return
    yield from _kept_down(flight)
    yield from _swings(flight)
    yield from _hovers_elsewhere(flight)


def _kept_down(flight: Flight) -> Iterator[Finding]:
    if (down := kept_down(flight)) is not None:
        kept, span = down
        highest = _highest_output(flight)
        reached = "" if highest is None else f"the outputs end at {highest:.0f} us of {kept.whole_us:.0f}, for "
        yield Finding(
            kind="thrust",
            title="too little thrust to take off",
            onset_s=span[0],
            end_s=span[1],
            severity="critical",
            evidence=f"{span[1] - span[0]:.0f} s at full throttle without rising; {reached}{kept}",
            source="CTUN.ThO, RCOU",
            suspect="parameter",
            probability=keeps_down(kept),
            parameters=(kept.parameter,),
            wanted=((kept.parameter, kept.wanted),),
        )


def keeps_down(kept: Kept) -> float:
    """How probable it is that a copter which spends all that its motors have lacks what this takes."""
    return float(np.interp(kept.share, (_TOO_LITTLE, _KEPT), (_SURE_P, _UNSURE)))


def ended(flight: Flight) -> Kept | None:
    """The parameter that ends a copter's outputs well below their range, where they reach that end."""
    kept = kept_from_range(flight, "MOT_")
    return kept if kept is not None and kept.share < _KEPT and _reaches(flight, kept) else None


def kept_down(flight: Flight) -> tuple[Kept, Span] | None:
    """The parameter that keeps a copter on the ground, and when; None where none does, and where one motor alone is at
    its end while the others have range left: that is a motor's own weakness."""
    kept, span = ended(flight), _spent_on_ground(flight)
    if kept is None or span is None:
        return None
    return (kept, span) if _all_are_spent(flight, span) else None


def _reaches(flight: Flight, kept: Kept) -> bool:
    """Whether the outputs reach what is left of their range; where none are recorded, too."""
    highest = _highest_output(flight)
    return highest is None or highest >= kept.end_us - _REACHED * kept.range_us


def _all_are_spent(flight: Flight, span: Span) -> bool:
    """Whether the outputs of half the motors are near the highest, for half of a time; where none are recorded, too."""
    tables = [(n, flight.one("RCOU", f"C{n}")) for n in range(1, 5)]
    outputs = [table.between(*span)[f"C{n}"] for n, table in tables if table is not None]
    levels = [float(known_median(one)) for one in outputs if np.isfinite(one).any()]
    least = flight.setting("MOT_PWM_MIN") or 0.0
    return not levels or float(np.median(levels)) - least >= _ALL * (max(levels) - least)


def _spent_on_ground(flight: Flight) -> Span | None:
    """The first span in which a copter that never flew spends its throttle; None where there is none."""
    if flight.throttle is None or flight.airborne:
        return None
    t, driven = flight.throttle
    high = smooth(t, driven, 4.0) > _SPENT
    return next(iter(lasting(t, high & during(flight.armed, t), _GROUNDED_S, gap_s=5.0)), None)


def _highest_output(flight: Flight) -> float | None:
    """What the motors were asked for at most, in microseconds; None where nothing tells."""
    outputs = [flight.one("RCOU", f"C{n}") for n in range(1, 5)]
    values = [one[f"C{n}"] for n, one in enumerate(outputs, start=1) if one is not None]
    return max((float(column[np.isfinite(column)].max(initial=0.0)) for column in values), default=0.0) or None


def _swings(flight: Flight) -> Iterator[Finding]:
    """A throttle that swings as no healthy one does: with a gain of the height control that was raised, or where the
    vehicle holds its height itself."""
    assert flight.throttle is not None
    t, driven = flight.throttle
    mean = smooth(t, driven, 3.0)
    raised = [name for name in _GAINS if _is_raised(flight, name)]
    spans = [(start + _EDGE_S, end - _EDGE_S) for start, end in flight.flown] if raised else _by_itself(flight, t, mean)
    flying = during(spans, t)
    if flying.sum() < _FEWEST:
        return
    swing, limit = float(median(np.abs(driven - mean)[flying])), _SWINGS if raised else _SWINGS_ALONE
    if swing > limit:
        told = [f"{name}={flight.setting(name):g}" for name in raised]
        yield Finding(
            kind="tuning",
            title="the throttle swings",
            onset_s=(flight.flown or spans)[0][0],
            end_s=(flight.flown or spans)[-1][1],
            severity="critical",
            evidence=f"half of the time it is {100 * swing:.0f}% and more off its mean (limit {100 * limit:.0f}%)"
            + (f" with {', '.join(told)}" if told else " where it holds its height itself, with no gain raised"),
            source="CTUN.ThO",
            suspect="parameter",
            probability=_GAIN_P if raised else _SWINGS_P,
            parameters=tuple(raised),
        )


def _by_itself(flight: Flight, t: Floats, mean: Floats) -> list[Span]:
    """Where it lifts, low or high, in modes in which the throttle is not the pilot's.

    Args:
        mean: its throttle over three seconds, at the times t.
    """
    lost_s = flight.lost_control_s if flight.lost_control_s is not None else flight.end_s
    lifts = (mean > _LIFTS) & during(flight.armed, t) & ~np.isin(flight.modes_at(t), BY_STICK)
    return lasting(t, lifts & (t < lost_s), _SWINGS_S)


def _is_raised(flight: Flight, name: str) -> bool:
    default, value = flight.default_left(name), flight.setting(name)
    return default is not None and value is not None and value > _RAISED * default


def _hovers_elsewhere(flight: Flight) -> Iterator[Finding]:
    """A hover throttle that nothing learns, and that is far from what hovering takes."""
    assert flight.throttle is not None
    value = flight.setting("MOT_THST_HOVER")
    if flight.setting("MOT_HOVER_LEARN") != 0 or not value or flight.default_left("MOT_THST_HOVER") is None:
        return
    t, driven = flight.throttle
    flying = during(((start + _EDGE_S, end - _EDGE_S) for start, end in flight.flown), t)
    if flying.sum() < _FEWEST:
        return
    hover = float(median(driven[flying]))
    if max(hover / value, value / max(hover, 1e-3)) > _HOVER:
        yield Finding(
            kind="tuning",
            title="MOT_THST_HOVER is not what hovering takes",
            onset_s=flight.flown[0][0],
            end_s=flight.flown[-1][1],
            severity="warning",
            evidence=f"hovering takes {hover:.2f}, MOT_THST_HOVER={value:g}, and MOT_HOVER_LEARN=0 learns none",
            source="CTUN.ThO",
            suspect="parameter",
            probability=_FEEDS_P,
            mission_lost=_FEEDS_LOST_P,
            parameters=("MOT_THST_HOVER",),
            wanted=(("MOT_THST_HOVER", round(hover, 2)),),
        )


CHECK = Check(
    "hover settings",
    "motors kept from their thrust, a throttle that swings or is fed wrongly",
    READS,
    LIMITS,
    find,
)
