"""The parts of the app that need no terminal: basket, clipboard, settings."""

from __future__ import annotations

import base64
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len

from care_core.application.deciding import decided
from care_core.causal.model import Summary
from care_core.ecosystems.findings import Event
from care_core.errors import ConfigError, UsageError
from care_core.records import replace
from care_core.run import Damage
from care_core.variables import Role, Variable
from care_tui.basket import Basket, nudged, parsed, possible
from care_tui.clipboard import MAX_BYTES, fits, osc52
from care_tui.render.health import FindingRow, health_row_item
from care_tui.render.objectives import damage, objective_detail
from care_tui.render.rows import UNICODE, labelled, without_middle
from care_tui.settings import Settings, load_settings, prepare_terminal, takes_only_ascii, with_flags
from tests.made import made_diagnosis
from tests.tui import sample_diagnosis as sample

FLOAT = Variable("gain", Role.OPTION, "float", "", "", (0.01, 10.0), 1.0)
INT = Variable("speed", Role.OPTION, "int", "cm/s", "", (30, 200), 50)
ENUM = Variable("mode", Role.OPTION, "enum", "", "", None, 0, ((0, "off"), (2, "on")))
FLAG = Variable("flag", Role.OPTION, "bool", "", "", None, 0)


@given(st.lists(st.sampled_from(["tick", "set", "load", "drop"]), max_size=8))
def test_undo_takes_back_whatever_was_done(steps: list[str]) -> None:
    basket = Basket({"a": 1.0}, {"a": 1.0, "b": 2.0})
    states = [(dict(basket.ticked), dict(basket.values))]
    for number, step in enumerate(steps):
        if step == "tick":
            basket.toggle("b")
        elif step == "set":
            basket.set("c", float(number), current=0.0)
        elif step == "load":
            basket.load({"d": float(number)})
        else:
            basket.drop("a")
        if (dict(basket.ticked), dict(basket.values)) != states[-1] or step in ("set", "load"):
            states.append((dict(basket.ticked), dict(basket.values)))
    for ticked, values in reversed(states[:-1]):
        assert basket.undo()
        assert (basket.ticked, basket.values) == (ticked, values)
    assert not basket.undo()


def test_another_value_leaves_a_change_at_its_place() -> None:
    basket = Basket({"a": 1.0, "b": 2.0}, {"a": 1.0, "b": 2.0})
    basket.set("a", 1.5, current=0.0)
    assert list(basket.ticked.items()) == [("a", 1.5), ("b", 2.0)]


def test_the_value_of_the_run_is_no_change() -> None:
    basket = Basket()
    basket.set("a", 3.0, current=1.0)
    basket.set("a", 1.0, current=1.0)
    assert basket.ticked == {}
    assert basket.toggle("a") is False, "nothing to tick"


@given(st.sampled_from([FLOAT, INT, ENUM, FLAG]), st.integers(-30, 30))
def test_a_nudge_stays_acceptable_and_moves(option: Variable, by: int) -> None:
    start = 0.0 if option in (ENUM, FLAG) else 50.0 if option is INT else 1.0
    value = nudged(option, start, by)
    assert option.accepts(value)
    if option in (FLOAT, INT) and by:
        assert (value > start) == (by > 0)


@pytest.mark.parametrize(
    ("option", "typed", "value"),
    [(FLOAT, "0.123456", 0.123456), (INT, "70", 70.0), (ENUM, "ON", 2.0), (FLAG, "true", 1.0)],
)
def test_values_are_typed_as_operators_write_them(option: Variable, typed: str, value: float) -> None:
    assert parsed(option, typed) == value


@pytest.mark.parametrize(("option", "typed"), [(FLOAT, "nan"), (FLOAT, "x"), (INT, ""), (ENUM, "perhaps")])
def test_what_cannot_be_taken_is_refused_with_what_can(option: Variable, typed: str) -> None:
    with pytest.raises(ValueError, match="not a number") as refused:
        parsed(option, typed)
    assert possible(option) in str(refused.value)


@pytest.mark.parametrize(("option", "typed"), [(FLOAT, "11"), (INT, "50.5"), (ENUM, "1"), (INT, "1e9")])
def test_a_value_that_the_option_may_not_have_is_refused(option: Variable, typed: str) -> None:
    with pytest.raises(ValueError, match="cannot be taken") as refused:
        parsed(option, typed)
    assert possible(option) in str(refused.value)


def test_osc_52_is_wrapped_for_the_multiplexer() -> None:
    plain = osc52("param set A 1\n", {})
    assert base64.b64decode(plain.removeprefix("\x1b]52;c;").removesuffix("\x07")) == b"param set A 1\n"
    tmux = osc52("x", {"TMUX": "/tmp/tmux-0/default,1,0", "TERM": "screen-256color"})
    assert tmux == "\x1bPtmux;\x1b" + osc52("x", {}) + "\x1b\\"
    screen = osc52("x" * 999, {"TERM": "screen.xterm"})
    parts = [part for part in screen.split("\x1b\\") if part]
    assert "".join(part.removeprefix("\x1bP") for part in parts) == osc52("x" * 999, {})
    assert fits("x" * MAX_BYTES)
    assert not fits("x" * (MAX_BYTES + 1))


def test_settings_are_read_checked_and_beaten_by_flags(tmp_path: Path) -> None:
    file = tmp_path / "s.yaml"
    file.write_text("theme: high-contrast\ncolor: 256\nmouse: false\nkeys: {step.next: n}\nplaces: [/logs]\n")
    settings = load_settings(file)
    assert settings == Settings(
        theme="high-contrast", color="256", mouse=False, keys={"step.next": "n"}, places=(Path("/logs"),)
    )
    typed = with_flags(settings, ascii=True, mouse=True, color="16", theme=None)
    assert (typed.ascii, typed.mouse, typed.color, typed.theme) == (True, False, "16", "high-contrast")
    with pytest.raises(UsageError, match="no way to colour called 'pink'"):
        with_flags(settings, ascii=False, mouse=True, color="pink", theme=None)
    file.write_text("")
    assert load_settings(file) == Settings()


@pytest.mark.parametrize(
    ("content", "says"),
    [("them: x", "Did you mean 'theme'"), ("mouse: 3", "true or false"), ("fps: 900", "0 to 60"), ("- a", "no mapping"),
     ("color: blue", "auto or truecolor"), ("keys: {a: 1}", "action to key"), ("a: [", "no YAML"),
     ("places: x", "list")],
)  # fmt: skip
def test_settings_that_cannot_be_taken_are_refused_with_the_key(tmp_path: Path, content: str, says: str) -> None:
    file = tmp_path / "s.yaml"
    file.write_text(content)
    with pytest.raises(ConfigError) as refused:
        load_settings(file)
    assert says in str(refused.value)
    assert str(file) in str(refused.value)


def test_a_settings_file_that_is_named_must_exist(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ConfigError, match="No such file"):
        load_settings(tmp_path / "none.yaml")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert load_settings() == Settings()


@pytest.mark.parametrize(
    ("encoding", "term", "only_ascii"),
    [
        ("utf-8", "xterm-256color", False),
        ("UTF8", "tmux-256color", False),
        ("ascii", "xterm", True),
        ("iso8859-1", "xterm", True),
        ("cp437", "xterm", True),
        ("no-such-encoding", "xterm", True),
        ("utf-8", "linux", True),
        ("utf-8", "vt220", True),
        ("utf-8", "", False),
    ],
)
def test_ascii_is_decided_by_locale_and_name_of_the_terminal(encoding: str, term: str, only_ascii: bool) -> None:
    assert takes_only_ascii(encoding, term) is only_ascii


def test_ssh_gets_fewer_frames_unless_told_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("TEXTUAL_FPS", "NO_COLOR", "TEXTUAL_COLOR_SYSTEM"):
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    prepare_terminal(Settings())
    assert os.environ.pop("TEXTUAL_FPS") == "500"
    monkeypatch.setenv("SSH_CONNECTION", "1.2.3.4 1 5.6.7.8 22")
    prepare_terminal(Settings(color="16"))
    assert os.environ["TEXTUAL_FPS"] == "30"
    assert os.environ["TEXTUAL_COLOR_SYSTEM"] == "standard"
    prepare_terminal(Settings(color="none"))
    assert os.environ["NO_COLOR"] == "1"
    for name in ("TEXTUAL_FPS", "NO_COLOR", "TEXTUAL_COLOR_SYSTEM"):
        monkeypatch.setenv(name, "")


def test_a_parameter_that_is_set_aside_takes_no_advice_about_another_along() -> None:
    advice = ("change only gain to 1: it would settle it", "change only gain_up to 2: it would settle it")
    made = replace(made_diagnosis(), tell_more=advice)
    assert decided(made, made.fix, {"gain": "it is a spare"}).tell_more == advice[1:]


@pytest.mark.parametrize("name", ["a_very_long_name_of_a_flight_2026-11-20_10-12-13.BIN", "飛行" * 20 + ".BIN"])
def test_a_long_name_keeps_both_ends(name: str) -> None:
    told = without_middle(name, 26, UNICODE)
    assert cell_len(told) <= 26
    assert told.startswith(name[:3])
    assert told.endswith(".BIN")
    assert without_middle("short.BIN", 26, UNICODE) == "short.BIN"


@pytest.mark.parametrize("room", [40, 54, 80])
def test_the_ruler_of_an_objective_is_one_line(room: int) -> None:
    quantiles = tuple(float(value) for value in range(100, 201, 10))
    summary = Summary(count=500, mean=150.0, sd=30.0, quantiles=quantiles)
    rows = objective_detail(sample.SLOW, summary, UNICODE, room)
    (ruler,) = [row for row in rows if UNICODE.rule * 5 in row.content.plain]
    assert ruler.content.cell_length <= room


def test_an_objective_is_told_where_there_is_no_room_yet() -> None:
    """A pane that is not laid out has no width."""
    summary = Summary(count=500, mean=150.0, sd=30.0, quantiles=(100.0, 200.0))
    rows = objective_detail(sample.SLOW, summary, UNICODE, 9)
    assert any(row.content.plain.startswith("Distribution") for row in rows)


def test_a_label_that_is_wider_than_its_column_does_not_run_into_its_text() -> None:
    assert labelled("It led to", "a crash").content.plain == "It led to     a crash"
    assert labelled("Seen just before it", "no path").content.plain == "Seen just before it: no path"


@pytest.mark.parametrize(
    ("part", "told"),
    [
        (Damage("a packet has a wrong checksum", 12, 3.5), "a packet has a wrong checksum at byte 12, at 3.5 s"),
        (Damage("a line's time is impossible", 12), "a line's time is impossible at byte 12"),
        (
            Damage("sorted by time: up to 2.0 s out of order", None, 2.0),
            "sorted by time: up to 2.0 s out of order, at 2.0 s",
        ),
        (Damage("read to 3.5 s, cut at byte 12: cut short", 12, 3.5), "read to 3.5 s, cut at byte 12: cut short"),
    ],
)
def test_where_a_log_is_damaged_is_said_once(part: Damage, told: str) -> None:
    assert damage(part) == told


def test_times_of_events_stand_in_one_column_whatever_their_kind() -> None:
    lines = [
        health_row_item(FindingRow(Event(1.0, "a log says", kind, "")), UNICODE).plain
        for kind in ("error", "diagnostics")
    ]
    assert len({line.index("1.0 s") for line in lines}) == 1
