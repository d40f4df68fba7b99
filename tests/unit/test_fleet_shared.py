"""What rows share is counted in robots of one sort, and nothing is said that the counts do not carry."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from math import comb
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.fleet.fleet_report import together
from care_core.fleet.rows import Asked, Explained, Row, Seen
from care_core.fleet.shared import MAYBE, shared
from care_core.records import replace
from care_core.report.fleet import shared_lines

_digests = count()
OLD, NEW = "ArduCopter V4.4.0", "ArduCopter V4.5.4"


def run(robot: str | None, cause: str | None = None, day: int | None = None, **given: Any) -> Row:
    """A flight; one with a cause failed by it."""
    config = {"speed": 5.0, "gain": 1.0, **given.pop("config", {})}
    row = Row(
        log=f"{robot}_{next(_digests)}.BIN",
        status="fault" if cause else "ok",
        robot=robot,
        sha256=f"{next(_digests)}",
        start=None if day is None else f"2026-11-{day:02}T09:00:00+00:00",
        kind="multicopter",
        profile="arducopter",
        version="2",
        fit="fits",
        breaches=("mission_time",) if cause else (),
        explained=(Explained("parameter", cause, 0.8),) if cause else (),
        off=dict.fromkeys(config, 0.0),
        asked=Asked(config, {}, {}),
    )
    return replace(row, **given)


def causes(rows: Sequence[Row]) -> list[Any]:
    return [pattern for pattern in shared(rows) if pattern.kind == "cause"]


def test_a_cause_on_several_robots_with_what_sets_them_apart() -> None:
    bad = [run(f"r{n}", "speed", 12 + n, firmware=NEW, config={"speed": 1.0 + n}) for n in range(4)]
    good = [run(f"g{n}", None, 12 + n, firmware=OLD) for n in range(4)]
    early = [run(f"r{n}", None, 1 + n, firmware=OLD) for n in range(4)]
    (found,) = causes([*bad, *good, *early])
    assert (found.name, found.unit, found.affected, found.of) == ("speed", "robot", ("r0", "r1", "r2", "r3"), 8)
    assert (found.runs, found.of_runs) == (4, 12)
    assert found.values == (1.0, 4.0)
    assert found.others_values == (5.0, 5.0)
    (firmware,) = found.traits
    assert (firmware.name, firmware.value, firmware.others_with, firmware.others) == ("firmware", NEW, 0, 4)
    assert firmware.instead == (OLD,)
    assert firmware.chance == pytest.approx(1 / comb(8, 4))
    since = found.since
    assert since is not None
    assert (since.start[:10], since.earlier, since.later_with, since.later) == ("2026-11-12", 4, 4, 8)
    assert since.chance == pytest.approx(comb(8, 4) / comb(12, 4))
    text = " ".join(" ".join(shared_lines(together([*bad, *good, *early]), {})).split())
    assert "the parameter speed explains failures on 4 of 8 robots (4 of 12 runs), multicopter: r0, r1, r2" in text
    assert f"all 4 have firmware {NEW}, of the 4 others none ({OLD})" in text
    assert f"none ({OLD}); may be chance" not in text


def test_a_trait_that_the_others_have_too_or_that_few_robots_show_by_chance_is_not_told_as_sure() -> None:
    bad = [run(f"r{n}", "speed", firmware=NEW) for n in range(2)]
    everyone = causes([*bad, run("g", None, firmware=NEW)])
    assert everyone[0].traits == ()
    maybe = causes([*bad, *(run(f"g{n}", None, firmware=OLD) for n in range(2))])
    assert [(trait.chance, trait.is_sure) for trait in maybe[0].traits] == [(pytest.approx(1 / 6), False)]
    # With more that differs something or other is to be expected.
    odd = [run(f"g{n}", None, firmware=OLD, config={"gain": float(n), "speed": 9.0}, frame=f"{n}") for n in range(2)]
    assert causes([*[replace(row, frame="x") for row in bad], *odd])[0].traits == ()


def test_an_unaffected_robot_that_ever_had_the_trait_counts_as_having_it() -> None:
    bad = [run(f"r{n}", "speed", firmware=NEW) for n in range(3)]
    mixed = [run(f"g{n}", None, firmware=firmware) for n in range(3) for firmware in (OLD, NEW)]
    assert causes([*bad, *mixed])[0].traits == ()
    wavering = [*bad, run("r0", "speed", firmware=OLD)]
    assert causes([*wavering, *(run(f"g{n}", None, firmware=OLD) for n in range(9))])[0].traits == ()


def test_who_does_not_say_may_have_it_too() -> None:
    bad = [run(f"r{n}", "speed", firmware=NEW) for n in range(4)]
    others = [run(f"g{n}", None, firmware=OLD) for n in range(4)]
    assert causes([*bad, *others])[0].traits
    assert not causes([*bad, *others, run("silent", None, firmware="")])[0].traits


def test_ten_runs_of_one_robot_are_one_witness_and_copies_are_one_run() -> None:
    assert shared([run("r", "speed") for _ in range(10)]) == ()
    one = run("r", "speed")
    assert shared([one, replace(one, robot="q", log="copy.BIN")]) == ()


def test_runs_are_counted_where_logs_name_no_robots() -> None:
    (found,) = causes([run(None, "speed"), run("r", "speed"), run("q", None)])
    assert (found.unit, len(found.affected), found.of) == ("run", 2, 3)


def test_robots_of_another_sort_or_profile_are_no_others() -> None:
    rows = [run("a", "speed"), run("b", "speed"), run("c", None, kind="rover"), run("d", None, profile="x"), run("e")]
    rows.append(replace(run("f"), status="not_evaluated"))
    (found,) = causes(rows)
    assert found.others == ("e",)
    assert [one.sort for one in shared(rows)] == ["multicopter"]


def test_a_weak_explanation_is_no_cause() -> None:
    weak = (Explained("parameter", "speed", 0.4), Explained("chance", "", 0.35))
    rows = [run("a", "speed", explained=weak), run("b", "speed", explained=weak), run("c")]
    assert [pattern.kind for pattern in shared(rows)] == ["breach"]


def test_findings_of_one_kind_are_one_and_the_same_robots_are_told_once() -> None:
    def lost(robot: str, motor: int) -> Row:
        title = f"motor {motor} lost thrust"
        why = (Explained("hardware", title, 0.9, "motor"),)
        return run(robot, "speed", explained=why, findings=(Seen("motor", title, "critical"),))

    (found,) = shared([lost("a", 1), lost("b", 3), run("c")])
    assert (found.kind, found.what, found.affected) == ("cause", "hardware", ("a", "b"))
    assert found.name == "motor (such as: motor 1 lost thrust)"
    assert shared([lost("a", 2), lost("b", 2)])[0].name == "motor 2 lost thrust"


def test_there_is_no_since_where_a_run_has_no_date_or_nothing_came_before() -> None:
    assert causes([run("a", "speed", 3), run("b", "speed"), run("c", None, 1)])[0].since is None
    rows = [run("a", "speed", 3), run("b", "speed", 4), run("c", None, 5)]
    since = causes(rows)[0].since
    assert since is not None
    assert since.earlier == 0
    assert "from the first run with a date on, 3 November 2026 09:00 UTC" in "\n".join(shared_lines(together(rows), {}))
    # One run before, of four: that says nothing. With six it may.
    assert causes([*rows, run("d", None, 1)])[0].since is None
    early = [run(f"e{n}", None, 1) for n in range(6)]
    doubtful = " ".join(" ".join(shared_lines(together([*rows[:2], *early]), {})).split())
    assert "since 3 November 2026 09:00 UTC: in 2 of 2 runs from then on, in none of the 6 runs before" in doubtful


def test_nothing_shared_is_said() -> None:
    assert list(shared_lines(together([run("a", "speed"), run("b")]), {})) == [
        "Nothing is shared: no cause, finding or breach is on 2 robots or more."
    ]


@given(
    st.lists(
        st.tuples(st.sampled_from("abcdef"), st.booleans(), st.sampled_from([OLD, NEW, ""]), st.integers(1, 28)),
        min_size=1,
        max_size=20,
    )
)
def test_whatever_is_told_can_be_counted_again(given: list[tuple[str, bool, str, int]]) -> None:
    rows = [run(robot, "speed" if bad else None, day, firmware=firmware) for robot, bad, firmware, day in given]
    bad = {robot for robot, failed, _, _ in given if failed}
    for pattern in shared(rows):
        assert set(pattern.affected) == bad
        assert set(pattern.others) == {robot for robot, *_ in given} - bad
        for trait in pattern.traits:
            assert {firmware for robot, failed, firmware, _ in given if failed} == {trait.value}
            having = {robot for robot, _, firmware, _ in given if robot not in bad and firmware == trait.value}
            assert len(having) == trait.others_with < trait.others == len(pattern.others)
            assert trait.chance <= MAYBE
