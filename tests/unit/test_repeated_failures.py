"""Several logs of one configuration are diagnosed together."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from care_core.causal.model import NoiseCarryOver
from care_core.diagnose.judging import Judged, judge, with_repeats
from care_core.diagnose.triage import triage
from care_core.errors import UsageError
from care_core.profile.store import Profile
from care_core.records import replace
from care_core.run import ProfileChoice
from tests.planted import DEFAULTS, SCHEMA, planted_run, run_of

CHOICE = ProfileChoice("planted", "1", "Simulated robot", "")


def judged(profile: Profile, digest: str, outcome: Mapping[str, float], **options: float) -> Judged:
    run = run_of({**DEFAULTS, **options}, outcome)
    return judge(replace(run, log=replace(run.log, sha256=digest)), SCHEMA, profile.model)


def outcome(time: float) -> dict[str, float]:
    """What a mission with a slow hold would have given, but for its time."""
    met = planted_run(reserve=40.0)
    known = {**met.metrics, **met.objectives, "time": time}
    return {name: float(value) for name, value in known.items()}  # type: ignore[arg-type]


def test_a_second_slow_run_takes_chance_out_of_the_promise(planted: Profile) -> None:
    first = judged(planted, "a", outcome(260.0), reserve=40.0)
    alone = triage(first, planted, CHOICE)
    slow = judged(planted, "b", outcome(260.0), reserve=40.0)
    again = triage(with_repeats(first, [slow]), planted, CHOICE)
    good = judged(planted, "c", outcome(176.0), reserve=40.0)
    relieved = triage(with_repeats(first, [good]), planted, CHOICE)
    changed = {name: d.faults[0].causes[0].p_fixed or 0.0 for name, d in
               (("alone", alone), ("again", again), ("relieved", relieved))}  # fmt: skip
    assert changed["again"] < changed["alone"] < changed["relieved"]
    assert any("seen in 2 runs" in note for note in again.notes)


@pytest.mark.parametrize(
    ("pairs", "said"),
    [
        ((0, 0), "run-to-run variation was not measured"),
        ((0, 53), "measured only between days (53 pairs of training runs)"),
        ((4, 53), "measured on 4 pairs of training runs"),
    ],
)
def test_a_promise_says_what_is_known_of_how_runs_resemble_each_other(
    planted: Profile, pairs: tuple[int, int], said: str
) -> None:
    seen = {"time": NoiseCarryOver(same=0.6, another=0.3, pairs=pairs)}
    training = replace(planted.model.training, carry_over=seen)
    profile = Profile(planted.path, planted.schema)
    vars(profile)["model"] = replace(planted.model, training=training)  # as if it had been read
    run = judged(profile, "a", outcome(260.0), reserve=40.0)
    assert any(note.endswith(said) for note in triage(run, profile, CHOICE).notes)


def test_another_configuration_and_the_same_log_are_no_repeats(planted: Profile) -> None:
    first = judged(planted, "a", outcome(260.0), reserve=40.0)
    with pytest.raises(UsageError, match="reserve was 40, then 50"):
        with_repeats(first, [judged(planted, "b", outcome(260.0), reserve=50.0)])
    with pytest.raises(UsageError, match="same recording"):
        with_repeats(first, [first])
