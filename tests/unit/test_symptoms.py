from __future__ import annotations

import pytest

from care_core.diagnose import symptoms
from care_core.diagnose.ranking import suspects
from care_core.diagnose.symptoms import pointers
from care_core.profile.store import Profile
from care_core.records import replace
from care_core.run import Evidence
from tests.planted import planted_query

NAMES = ("speed", "accel", "radius", "reserve", "min_sats", "planner")


@pytest.mark.parametrize(
    ("objective", "cause", "metric", "options"),
    [
        ("time", "reserve", "hold_s", {"reserve": 58, "accel": 2.0}),
        ("time", "planner", "replans", {"planner": 2, "accel": 2.0}),
        ("energy", "accel", "sag", {"accel": 3.9, "reserve": 30}),
    ],
)
def test_the_metric_that_is_off_points_at_what_moved_it(
    planted: Profile, objective: str, cause: str, metric: str, options: dict[str, float]
) -> None:
    found = pointers(planted_query(planted, **options), objective, NAMES, (), ())
    assert sum(p.share for p in found.values()) == pytest.approx(1.0)
    assert max(found, key=lambda name: found[name].share) == cause
    assert found[cause].metric == metric


def test_a_run_like_the_reference_points_at_nothing(planted: Profile) -> None:
    found = pointers(planted_query(planted), "time", NAMES, (), ())
    assert {pointer.share for pointer in found.values()} == {0.0}


def test_last_digits_point_at_nobody(planted: Profile, monkeypatch: pytest.MonkeyPatch) -> None:
    """A metric that this run's wind moved, and no option: sums in another order differ in their last digits."""
    here = planted_query(planted)
    off = replace(here, observed={**here.observed, "hold_s": 500.0})
    monkeypatch.setattr(symptoms, "_latent", lambda _world, _, configs: [1.0 - 1e-15 * i for i in range(len(configs))])
    assert {pointer.share for pointer in pointers(off, "time", NAMES, (), ()).values()} == {0.0}


def test_a_check_that_refused_the_mission_outweighs_every_metric(planted: Profile) -> None:
    here = planted_query(planted, min_sats=13, speed=1.5)
    refusal = Evidence(1.0, "not enough satellites", "refusal", ("min_sats",))
    found = pointers(here, "success", NAMES, (), (refusal,))
    assert found["min_sats"].share > 0.5
    assert suspects(here, "success", said=(refusal,))[0].option == "min_sats"


def test_what_no_contribution_explains_is_laid_to_the_symptoms(planted: Profile) -> None:
    for suspect in suspects(planted_query(planted, reserve=58, speed=4.0), "time"):
        assert suspect.weight >= suspect.contribution - 1e-12
        assert suspect.weight <= 1.0 + 1e-9
