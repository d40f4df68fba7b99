"""Text of others in a table, which nobody computes by opening it, and the one clock of every report."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.text import LONG_S, but_for_numbers, cell, log_time, log_times, seconds, times_until, wrapped

CORE = Path(__file__).parents[2] / "care_core"


@pytest.mark.parametrize("text", ['=HYPERLINK("http://a","b")', "+1", "-1+1", "@SUM(A1)"])
def test_a_formula_is_text(text: str) -> None:
    assert cell(text) == f"'{text}"


@pytest.mark.parametrize(("text", "shown"), [("plain", "plain"), ("", ""), ("a=b", "a=b"), ("\x1b[0m", "\\x1b[0m")])
def test_what_is_none_stays(text: str, shown: str) -> None:
    assert cell(text) == shown


@pytest.mark.parametrize(
    ("time_s", "shown"),
    [
        (0.0, "0.0 s"),
        (61.34, "61.3 s"),
        (99.94, "99.9 s"),
        (99.96, "100.0 s (1:40)"),
        (312.4, "312.4 s (5:12)"),
        (3599.96, "3600.0 s (1:00:00)"),
        (4000.0, "4000.0 s (1:06:40)"),
        (-150.0, "-150.0 s (-2:30)"),
        (None, "an unknown time"),
        (float("nan"), "an unknown time"),
    ],
)
def test_a_time_has_seconds_and_from_100_s_on_minutes(time_s: float | None, shown: str) -> None:
    assert log_time(time_s) == shown


def test_a_rounded_time_counts_its_minutes_from_what_is_shown() -> None:
    assert log_time(317.7, 0) == "318 s (5:18)"
    assert log_time(11.2, 0) == "11 s"


@given(st.floats(100.1, 1e5))
def test_a_time_has_the_same_minutes_however_many_decimals_it_is_told_with(time_s: float) -> None:
    assert log_time(time_s).partition(" (")[2] == log_time(time_s, 0).partition(" (")[2]
    assert log_time(time_s).endswith(f"({seconds(time_s)})") or time_s < LONG_S


def test_what_is_said_again_has_its_count() -> None:
    assert times_until(1, 305.2) == ""
    assert times_until(94, 305.2) == " (94 times until 305 s (5:05))"
    assert but_for_numbers("Potential Thrust Loss (1)") == but_for_numbers("Potential Thrust Loss (4)")


def test_times_of_a_column_stand_below_each_other() -> None:
    assert log_times([8.25, 317.7, None]) == ["  8.2 s       ", "317.7 s (5:18)", "      ?       "]
    assert log_times([1.0, 12.0]) == [" 1.0 s", "12.0 s"]
    assert log_times([]) == []


def test_no_other_clock_is_used_where_the_core_writes_text() -> None:
    """The narrow one is for columns of the app, and for the axes of plots."""
    users = [
        path.name
        for path in CORE.rglob("*.py")
        if "seconds" in (text := path.read_text(encoding="utf-8"))  # to parse every module takes seconds
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.ImportFrom) and node.module == "care_core.text"
        if "seconds" in [name.name for name in node.names]
    ]
    assert users == ["axes.py"]


@pytest.mark.parametrize("figure", ["1.8 s", "109.5 s (1:49)", "12 m/s", "3500 mAh", "19%", "12.6 V", "400 Hz"])
def test_no_line_ends_between_a_number_and_its_unit(figure: str) -> None:
    for width in range(20, 40):
        assert any(figure in line for line in wrapped(f"the vehicle was seen {figure}, and that is all", width=width))


def test_a_number_is_held_to_nothing_but_its_unit() -> None:
    assert wrapped("it came 53 times", width=12) == ["it came 53", "times"]
    assert wrapped("motor 1 slower", width=8) == ["motor 1", "slower"]
