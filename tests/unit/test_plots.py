"""Plots of a report: few points that keep every spike, gaps that stay gaps, and drawings that anybody can read."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import care_core
from care_core.application.plotting import MOST_POINTS, drawn_of, thinned
from care_core.application.sharing import Sharing
from care_core.diagnose.records import Fault, PathNode
from care_core.files import bundled
from care_core.records import replace
from care_core.report.document import build_document
from care_core.report.html import to_html
from care_core.report.marks import Mark
from care_core.report.path_drawing import paths_svg
from care_core.report.plots import Band, Drawing, Limit, Line, Plot, plot_figure
from tests.made import HOSTILE, made_diagnosis

NASTY = f"</script><script>alert(1)</script>\"'{HOSTILE}"


@given(st.integers(1, 5000), st.integers(0, 10_000), st.integers(8, 600))
def test_thinning_keeps_the_extremes_and_few_points(count: int, seed: int, most: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.sort(rng.uniform(0.0, 100.0, count))
    values = rng.normal(size=count)
    kept = thinned(t, values, (0.0, 100.0), most)
    assert len(kept) <= max(most, 2) + 2
    assert np.all(np.diff(kept) > 0)
    assert values[kept].max() == values.max()
    assert values[kept].min() == values.min()
    assert {0, count - 1} <= set(kept.tolist())


def made_plot(values: list[float], **more: object) -> Plot:
    points = tuple((float(i), value) for i, value in enumerate(values))
    return replace(Plot("height", "POS Alt", "m", ("climb",), (Line("Alt", (points,)),)), **more)


@pytest.mark.parametrize("values", [[1.0], [5.0] * 10, [0.0, 1e9, -1e9], [1e-12, 2e-12], [0.0, 0.0]])
def test_any_values_can_be_drawn(values: list[float]) -> None:
    drawn = Drawing(start_s=0.0, end_s=max(len(values) - 1.0, 1e-9))
    figure = ElementTree.fromstring("".join(plot_figure(made_plot(values), drawn, "p")))
    path = next(one for one in figure.iter("path") if one.get("class") == "line line1").get("d", "")
    places = [float(number) for number in re.findall(r"-?\d+\.\d", path)]
    assert all(-1 <= place <= 1001 for place in places)
    assert "nan" not in path


def test_a_plot_says_in_words_what_it_shows() -> None:
    plot = made_plot(
        [1.0, 9.0, 2.0], limits=(Limit(8.0, "ceiling"),), bands=(Band(1.0, 2.0, "critical", "motor 4 lost thrust"),)
    )
    marks = (Mark(0.0, "arming", "armed", 3), Mark(1.0, "critical", "motor 4 lost thrust", 0))
    figure = ElementTree.fromstring(
        "".join(plot_figure(plot, Drawing(marks=marks, end_s=2.0, since="the start of the mission"), "p"))
    )
    svg = next(figure.iter("svg"))
    assert svg.get("role") == "img"
    told = next(one.text or "" for one in figure.iter("desc"))
    for part in ("from the start of the mission", "Alt: 1 to 9 m", "ceiling: 8 m", "motor 4 lost thrust from 1.0 s"):
        assert part in told
    assert [one.text for one in figure.iter("span") if "sign" in one.get("class", "")] == ["1", "2"]
    assert "ceiling: 8 m" in [one.text for one in figure.iter("span")]


def test_a_gap_of_the_log_is_a_gap_of_the_line_and_spikes_stay() -> None:
    case = care_core.triage(bundled("samples", "arducopter_motor.BIN"))
    drawn = drawn_of(case)
    lines = [line for plot in drawn.plots for line in plot.lines]
    assert max(sum(map(len, line.segments)) for line in lines) <= MOST_POINTS + 2
    motors = drawn.plots[0]
    assert motors.source == "RCOU C1, C2, C3, C4", "what the first finding is seen in is drawn first"
    assert motors.bands[0].words == "motor 4 (rear) lost thrust"
    assert {mark.words for mark in drawn.marks} >= {"motor 4 (rear) lost thrust", "took off"}
    volt = next(plot for plot in drawn.plots if plot.source == "BAT Volt")
    assert {limit.words for limit in volt.limits} == {"BATT_LOW_VOLT", "BATT_CRT_VOLT"}
    shared = drawn_of(case, Sharing(positions=False))
    assert not [plot for plot in shared.plots if {"Lat", "Lng", "GMS", "GWk"} & set(plot.source.split())]


def test_the_page_of_a_flight_draws_its_limits_and_stays_small() -> None:
    case = care_core.triage(bundled("samples", "arducopter_failed.BIN"))
    drawn = drawn_of(case)
    assert [limit.words for limit in drawn.deadlines] == ["limit of mission_time"]
    energy = next(plot for plot in drawn.plots if plot.source == "BAT EnrgTot")
    assert energy.matters
    assert "energy" in energy.read_for
    assert energy.limits[0].words == "limit of energy"
    page = case.report("html")
    assert len(page.encode()) < 1_000_000
    assert page.count("<svg") == page.count("<desc")
    assert "http" not in re.sub(r'http-equiv="', "", page)
    assert page.count("<th ") == page.count('<th scope="col"')


def test_paths_are_drawn_left_to_right_with_effect_and_support() -> None:
    (fault,) = made_diagnosis().faults
    (cause,) = fault.causes
    longer = (cause.path[0], PathNode("sink", "m", 1.0, 2.0, 0.5, 0.3), *cause.path[1:])
    other = replace(cause, rank=2, option=replace(cause.option, name="other"),
                    path=(replace(longer[0], name="other"), *longer[1:]))  # fmt: skip
    svg = ElementTree.fromstring("".join(paths_svg(Fault(fault.objective, (cause, other)), "p")))
    boxes = [float(one.get("x", "")) for one in svg.iter("rect")]
    names = [one.text for one in svg.iter("text") if one.get("class") == "name"]
    assert dict(zip(names, boxes, strict=True))["land_speed"] == dict(zip(names, boxes, strict=True))["other"]
    assert names.count("mission_time") == names.count("land_time") == 1, "shared steps are drawn once"
    place = dict(zip(names, boxes, strict=True))
    assert place["other"] < place["sink"] < place["land_time"] < place["mission_time"]
    texts = [one.text for one in svg.iter("text")]
    assert {"\u22120.80", "in 97%", "driven 16 cm/s", "suggested 50 cm/s", "wanted <= 150 s"} <= set(texts)
    assert "other leads to sink" in next(one.text or "" for one in svg.iter("desc"))


def test_names_of_a_log_are_no_markup_in_any_drawing() -> None:
    made = made_diagnosis()
    (fault,) = made.faults
    path = tuple(replace(node, name=NASTY, unit=NASTY) for node in fault.causes[0].path[:1]) + fault.causes[0].path[1:]
    faults = (replace(fault, causes=(replace(fault.causes[0], path=path),)),)
    plot = made_plot(
        [1.0, 2.0], words=NASTY, source=NASTY, unit=NASTY, read_for=(NASTY,), limits=(Limit(1.5, NASTY),),
        bands=(Band(0.0, 1.0, "warning", NASTY),), lines=(Line(NASTY, (((0.0, 1.0), (1.0, 2.0)),)), Line("b", ())),
    )  # fmt: skip
    drawn = Drawing(faults, (plot,), (Mark(0.5, "crash", NASTY, 0),), (Limit(0.5, NASTY),), 0.0, 1.0)
    page = to_html(build_document(made), drawn)
    assert "<script" not in page
    assert not set(page) & {"\x1b", "\x07", "\u202e"}
    assert page.count("&lt;/script&gt;") >= 10
