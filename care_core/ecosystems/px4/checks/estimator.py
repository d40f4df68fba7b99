"""Sensors that the estimator does not believe."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4.episodes import Episode, State, episode
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.logs.base import Wanted

_TOPIC = "estimator_status"
LIMITS = Limits()
_REJECTED = LIMITS.add(
    "innovation test ratio", 1.0, "", "EstimatorStatus.msg: EKF2 does not use a sensor whose ratio is above 1"
)
_SHORTEST_S = LIMITS.add("shortest rejection", 1.0, "s", "a choice: single outliers are what the test is for")
_PLACE_P = LIMITS.add("probability of the GPS, position rejected", 0.85, "", "training flights: 5 of 5")
_PLACE_LOST_P = LIMITS.add("probability that a mission fails so", 0.85, "", "training flights: 5 of 5")
_COMPASS_P = LIMITS.add(
    "probability of the compass, rejected", 0.8, "", "training flights: 2 of 2; as a disturbed field"
)
_COMPASS_LOST_P = LIMITS.add("probability that it fails for a compass", 0.1, "", "training flights: 0 of 6")

STATES = (
    State(_TOPIC, "vel_test_ratio", "estimator rejects velocity", "gps"),
    State(_TOPIC, "pos_test_ratio", "estimator rejects position", "gps",
          probability=_PLACE_P, mission_lost=_PLACE_LOST_P),
    State(_TOPIC, "hgt_test_ratio", "estimator rejects height", "barometer"),
    State(_TOPIC, "mag_test_ratio", "estimator rejects compass", "compass",
          probability=_COMPASS_P, mission_lost=_COMPASS_LOST_P),
    State(_TOPIC, "hdg_test_ratio", "estimator rejects heading", "compass",
          probability=_COMPASS_P, mission_lost=_COMPASS_LOST_P),
)  # fmt: skip
"""Newer firmware publishes the ratio of the heading, whatever gives it, in place of the compass's."""

READS: Wanted = {_TOPIC: tuple(state.field for state in STATES)}


def episodes(flight: Px4Flight) -> Iterator[Episode]:
    """Sensors rejected while it was armed."""
    for state in STATES:
        table = flight.table(_TOPIC, state.field)
        if table is not None:
            source = f"{_TOPIC}.{state.field} above {_REJECTED:g}"
            found = episode(flight, table, table[state.field] > _REJECTED, state, source, _SHORTEST_S)
            if found is not None:
                yield found


def find(flight: Px4Flight) -> Iterator[Finding]:
    yield from filter(None, (found.finding() for found in episodes(flight)))


CHECK = Check("estimator", "sensors that the estimator rejects", READS, LIMITS, find)
