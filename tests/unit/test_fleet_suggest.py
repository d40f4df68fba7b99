"""One change for a fleet: for most of those that fail and against none that does well, or none."""

from __future__ import annotations

from pathlib import Path

import pytest

from care_core.application.case import Request
from care_core.application.fleet import triage_one
from care_core.diagnose.estimates import WORTH
from care_core.diagnose.noisy_or import NoisyOr
from care_core.fleet.fleet_report import together
from care_core.fleet.rows import Explained, NamedCause, Row
from care_core.fleet.sources import Source
from care_core.fleet.suggest import Silence, Suggestion, suggest
from care_core.profile.store import Profile, load_profile
from care_core.records import replace
from care_core.report.fleet import suggestion_lines

ROOT = Path(__file__).parents[2]
SLOW = 16.0


def triaged(path: Path) -> Row:
    return triage_one(Source(str(path), path), Request(path))


@pytest.fixture(scope="module")
def failed() -> Row:
    """A flight that took too long because it landed at 16 cm/s."""
    return triaged(ROOT / "samples" / "arducopter_failed.BIN")


@pytest.fixture(scope="module")
def fine() -> Row:
    return triaged(ROOT / "tests" / "data" / "arducopter_good.BIN")


def on(robot: str, row: Row, **config: float) -> Row:
    """The same flight, of another robot with these values."""
    assert row.asked is not None
    asked = replace(row.asked, config={**row.asked.config, **config})
    return replace(row, robot=robot, recording=f"of {robot}", log=f"{robot}.BIN", asked=asked)


def only(rows: list[Row]) -> Suggestion | Silence:
    (found,) = suggest(rows)
    return found


def test_the_row_of_a_flight_says_what_its_triage_says(failed: Row, fine: Row) -> None:
    assert (failed.status, failed.breaches) == ("fault", ("mission_time", "energy"))
    assert (failed.robot, failed.called) == ("Dd1219c7c4c5404aaa", "machine Dd1219c7")
    assert failed.main is not None
    assert (failed.main.what, failed.main.name) == ("parameter", option_of(failed))
    assert failed.asked is not None
    assert failed.asked.config[option_of(failed)] == SLOW
    model = load_profile("arducopter").model
    (value,) = failed.change.values()
    then = failed.asked.odds(model, failed.breaches, [{**failed.asked.config, option_of(failed): value}])
    # The row asks the same model and the same causes the same question as the triage did.
    assert failed.p_fixed == pytest.approx(then[0])
    assert (fine.status, fine.breaches, fine.main) == ("ok", (), None)


def broken_part(row: Row) -> Row:
    """The row of a run that a part explains better than anything else."""
    assert row.asked is not None
    causes = NoisyOr({("hardware", "motor 2 lost thrust"): 0.95, ("parameter", option_of(row)): 0.1})
    explained = (Explained("hardware", "motor 2 lost thrust", 0.9, "motor"),)
    return replace(row, explained=explained, asked=replace(row.asked, failure=causes))


def option_of(row: Row) -> str:
    return next(iter(row.change))


def test_a_change_that_helps_most_and_harms_none(failed: Row, fine: Row) -> None:
    option = option_of(failed)
    broken = broken_part(on("broken", failed))
    found = only([on("a", failed), on("b", failed), on("c", failed), broken, on("good", fine)])
    assert isinstance(found, Suggestion)
    assert (found.option.name, found.value) == (option, failed.change[option])
    assert [one.name for one in found.having("helped")] == ["a", "b", "c"]
    (not_helped,) = found.having("not helped")
    assert (not_helped.name, not_helped.why) == ("broken", "motor 2 lost thrust")
    assert [one.name for one in found.having("unharmed")] == ["good"]
    text = " ".join(" ".join(suggestion_lines(together([on("a", failed), on("b", failed)]), {})).split())
    assert "It would help 2 of the 2 robots that fail, and harms none that does well." in text


def test_a_change_that_harms_a_robot_which_does_well_is_not_suggested(failed: Row, fine: Row) -> None:
    assert fine.asked is not None
    assert failed.asked is not None
    # It lands faster than any value that would repair the others, and has a limit of time that needs it.
    op, _ = fine.asked.thresholds["mission_time"]
    tight = {**fine.asked.thresholds, "mission_time": (op, fine.objectives["mission_time"] + 2.0)}
    fast = replace(fine, asked=replace(fine.asked, thresholds=tight))
    slowed = on("good", fast, **{option_of(failed): 120.0})
    found = only([on("a", failed), on("b", failed), slowed])
    assert isinstance(found, Silence)
    assert found.best is not None
    assert [one.name for one in found.best.having("harmed")] == ["good"]
    assert "and harm 1 that did well" in found.reason


def test_no_change_where_it_helps_no_majority_or_one_robot_alone(failed: Row, fine: Row) -> None:
    broken = [broken_part(on(f"x{n}", failed)) for n in range(2)]
    found = only([on("a", failed), on("b", failed), *broken])
    assert isinstance(found, Silence)
    assert "2 of the 4 robots that fail" in found.reason
    alone = only([on("a", failed), replace(on("a", failed), recording="again"), on("good", fine)])
    assert isinstance(alone, Silence)
    assert "only one robot fails" in alone.reason
    assert suggest([on("good", fine)]) == ()


def test_a_robot_is_helped_where_most_of_its_failures_are(failed: Row) -> None:
    again = [replace(broken_part(on("a", failed)), recording=f"{n}") for n in range(2)]
    found = only([on("a", failed), *again, on("b", failed), on("c", failed)])
    assert isinstance(found, Suggestion)
    assert [one.name for one in found.having("helped")] == ["b", "c"]
    assert [one.name for one in found.having("not helped")] == ["a"]


def test_a_robot_is_helped_by_what_a_change_adds(failed: Row, monkeypatch: pytest.MonkeyPatch) -> None:
    for worth, helped in ((0.0, ["a", "b"]), (0.99, [])):
        monkeypatch.setattr("care_core.diagnose.worth.WORTH", replace(WORTH, value=worth))
        found = only([on("a", failed), on("b", failed)])
        best = found if isinstance(found, Suggestion) else found.best
        assert best is not None
        assert [one.name for one in best.having("helped")] == helped


def test_what_another_version_of_the_profile_judged_is_not_asked(failed: Row) -> None:
    assert failed.asked is not None
    renamed = NamedCause("of another version", "high", 1.0, 2.0)
    lacking = replace(failed.asked, config={option_of(failed): SLOW})
    for strange in (
        replace(failed, version="0"),
        replace(failed, asked=lacking),
        replace(failed, version="0", causes=(renamed, *failed.causes)),
    ):
        found = only([replace(strange, robot=name, recording=name) for name in "ab"])
        assert isinstance(found, Silence)
        assert found.best is not None
        assert [one.why for one in found.best.outlooks] == ["no model can be asked about its runs"] * 2


def test_a_profile_that_is_not_here_or_was_learned_elsewhere_suggests_nothing(failed: Row) -> None:
    rows = [on("a", failed), on("b", failed)]
    (missing,) = suggest([replace(row, profile="nowhere") for row in rows])
    assert isinstance(missing, Silence)
    assert "There is no profile 'nowhere'" in missing.reason

    def carried(name: str) -> Profile:
        profile = load_profile(name)
        return replace(profile, schema=replace(profile.schema, carried_over="other robots"))

    (elsewhere,) = suggest(rows, carried)
    assert isinstance(elsewhere, Silence)
    assert "learned from other robots" in elsewhere.reason


def test_a_safety_option_is_only_put_back_to_its_reference(failed: Row) -> None:
    profile = load_profile("arducopter")
    option = option_of(failed)
    variables = {**profile.schema.variables, option: replace(profile.schema.variables[option], safety=True)}

    def careful(_name: str) -> Profile:
        return replace(profile, schema=replace(profile.schema, variables=variables))

    (found,) = suggest([on("a", failed), on("b", failed)], careful)
    assert isinstance(found, Suggestion)
    assert found.value == failed.off[option]
