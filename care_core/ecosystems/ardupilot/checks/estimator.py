"""The estimator: test ratios over their limit, failsafes, resets and changes of lane.

A ratio above 1 means that a measurement is rejected (AP_NavEKF3: innovation test ratios); the firmware's check acts at
FS_EKF_THRESH, 0.8, of two of them for a second (ekf_check.cpp). 97.5% of the healthy training flights stay below 0.16.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import lasting
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import Span, during, within
from care_core.ecosystems.vehicles.errors import EKF_CHECK, EKF_FAILSAFE
from care_core.logs.base import Wanted
from care_core.text import log_time

READS: Wanted = {"XKF4": ("SV", "SP", "SH", "SM", "FS")}

LIMITS = Limits()
RATIO = LIMITS.add("innovation test ratio", 1.0, "", "AP_NavEKF3: above it a measurement is rejected")
_LASTS_S = LIMITS.add("shortest rejection", 2.0, "s", "a choice: single outliers are what the test is for")
_REJECTED_P = LIMITS.add("probability that the estimator is at fault", 0.2, "", "a choice: mostly its sensors are")
_SWITCHED_P = LIMITS.add("probability of a changed lane", 0.3, "", "a choice: it switches to the better sensor")
_BOOTED_P = LIMITS.add("probability of ARMING_REQUIRE", 0.9, "", "it is all over once there is a position")
_STANDS_S = LIMITS.add("shortest check that is not cleared", 5.0, "s", "a choice: disarming ends it as well")
_TITLE = "the estimator rejects its measurements"
_WORDS = {"SV": "velocity", "SP": "position", "SH": "height", "SM": "magnetic field"}
_HEADINGS = {2.0: "heading of the GPS antennas", 6.0: "heading from external navigation"}
"""By EK3_SRC1_YAW; others are the compass's, or none is tested."""
_NEEDS_NO_ARMING = "ARMING_REQUIRE"
_LANE = re.compile(r"(lane switch|EKF primary changed|switching to (compass|IMU|GPS)|EKF Failsafe|EKF variance)", re.I)
_HAS_POSITION = re.compile(r"EKF\d IMU\d is using GPS|AHRS: EKF\d active")


class _Rejection(NamedTuple):
    """A measurement that the estimator rejected: from when until when, and how far off it was at most."""

    start_s: float
    end_s: float
    peak: float


def find(flight: Flight) -> Iterator[Finding]:
    """What the estimator made of its measurements while they mattered."""
    worst = _rejections(flight)
    failed = _inside(flight, [t for t, code in flight.errors(EKF_FAILSAFE) if code])
    failed += _inside(flight, [t for t, code in flight.errors(EKF_CHECK) if code])
    if not worst and not failed:
        standing = _not_cleared(flight)
        yield from _switched(flight) if standing is None else (_stands(*standing),)
    elif not worst and (position_s := _armed_before_position(flight, failed)) is not None:
        yield _armed_too_early(failed[0], position_s)
    else:
        yield _rejects(flight, worst, failed)


def _rejections(flight: Flight) -> dict[str, _Rejection]:
    """By field of XKF4, of the lane that rejected it first."""
    worst: dict[str, _Rejection] = {}
    for core in flight.all("XKF4", "SV", "SP", "SH", "SM"):
        for field in _WORDS:
            spans = lasting(core.t, (core[field] > RATIO) & during(flight.flown, core.t), _LASTS_S)
            if spans:
                start, end = spans[0][0], spans[-1][1]
                peak = float(np.max(core[field][(core.t >= start) & (core.t <= end)]))
                if field not in worst or start < worst[field].start_s:
                    worst[field] = _Rejection(start, end, peak)
    return worst


def _stands(start_s: float, end_s: float) -> Finding:
    return Finding(
        kind="estimator",
        title=_TITLE,
        onset_s=start_s,
        end_s=end_s,
        severity="warning",
        evidence=f"the firmware's EKF check failed at {log_time(start_s)} and was not cleared while it was armed",
        source=f"ERR {EKF_CHECK}",
        probability=_REJECTED_P,
    )


def _switched(flight: Flight) -> Iterator[Finding]:
    """Changes of its lane or sensor, where that is all that it did."""
    switched = _inside(flight, [t for t, text in flight.messages if _LANE.search(text)])
    if switched:
        yield Finding(
            kind="estimator",
            title="the estimator changed its lane or sensor",
            onset_s=switched[0],
            end_s=switched[-1],
            severity="info",
            evidence="; ".join(dict.fromkeys(text for t, text in flight.messages if t in switched)),
            source="MSG",
            probability=_SWITCHED_P,
        )


def _armed_too_early(failed_s: float, position_s: float) -> Finding:
    return Finding(
        kind="estimator",
        title="it was armed before it had a position",
        onset_s=failed_s,
        end_s=position_s,
        severity="critical",
        evidence=(
            f"EKF check or failsafe at {log_time(failed_s)}, the estimator has a position from "
            f"{log_time(position_s)} on; {_NEEDS_NO_ARMING} is 0: it is armed as it boots"
        ),
        source="ERR, MSG, PARM",
        suspect="parameter",
        probability=_BOOTED_P,
        parameters=(_NEEDS_NO_ARMING,),
        wanted=((_NEEDS_NO_ARMING, 1.0),),
    )


def _word(flight: Flight, field: str) -> str:
    """What a test ratio is of: of the heading it is what the estimator takes it from."""
    return _HEADINGS.get(flight.setting("EK3_SRC1_YAW") or 0.0, _WORDS[field]) if field == "SM" else _WORDS[field]


def _rejects(flight: Flight, worst: Mapping[str, _Rejection], failed: list[float]) -> Finding:
    by_time = sorted(worst.items(), key=lambda pair: pair[1].start_s)
    said = [f"{_word(flight, field)} {one.peak:.1f}" for field, one in by_time]
    evidence = f"test ratios above {RATIO:g}: {', '.join(said)}" if said else "the firmware's EKF check failed"
    if failed:
        evidence += f"; EKF check or failsafe at {log_time(min(failed))}"
    return Finding(
        kind="estimator",
        title=_TITLE,
        onset_s=min([one.start_s for one in worst.values()] + failed),
        end_s=max([one.end_s for one in worst.values()] + failed),
        severity="critical" if failed else "warning",
        evidence=evidence,
        source="XKF4.SV, SP, SH, SM, ERR; limit 1 of AP_NavEKF3, 0.8 of FS_EKF_THRESH",
        probability=_REJECTED_P,
    )


def _armed_before_position(flight: Flight, failed: list[float]) -> float | None:
    """When the estimator first had a position, where a vehicle that needs no arming failed its check before that alone;
    None where it did not."""
    if flight.setting(_NEEDS_NO_ARMING) != 0:
        return None
    first = min((t for t, text in flight.messages if _HAS_POSITION.match(text)), default=None)
    return first if first is not None and failed and max(failed) < first else None


def _not_cleared(flight: Flight) -> Span | None:
    """From when the firmware's check failed, on the ground, to the end of that arming, where it said no more of it."""
    told = flight.errors(EKF_CHECK)
    for start, end in flight.armed:
        last = next((one for one in reversed(told) if start <= one[0] <= end), None)
        if last is not None and last[1] and end - last[0] > _STANDS_S:
            return last[0], end
    return None


def _inside(flight: Flight, times: list[float]) -> list[float]:
    return sorted(t for t in times if within(flight.flown, t))


CHECK = Check("estimator", "test ratios over their limit, failsafes, changes of lane", READS, LIMITS, find)
