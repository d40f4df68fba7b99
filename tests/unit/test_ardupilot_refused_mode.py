"""A mission that was asked for and never began, as the firmware refused Auto."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from care_core.ecosystems.findings import Finding
from tests.flights import Made

AUTO, LOITER = 3.0, 5.0
Off = Mapping[str, tuple[float, float]]
NOISY: Off = {"EK3_VELNE_M_NSE": (5.0, 0.5)}
"""Values and defaults by name."""


def refused(*times: float, why: str = "requires position", mode: float = AUTO, off: Off | None = None) -> Made:
    made = Made()
    for name, (value, default) in (off or {}).items():
        made.settings[name], made.defaults[name] = value, default
    made.rows["ERR"] = [(t, {"Subsys": 10.0, "ECode": mode}) for t in times]
    made.rows["MSG"] += [(t, {"Message": f"Mode change to AUTO failed: {why}"}) for t in times]
    return made


def found(made: Made) -> list[Finding]:
    return [one for one in made.find() if one.title.startswith("Auto was refused")]


def test_auto_that_is_refused_to_the_end_names_what_its_position_goes_by() -> None:
    (one,) = found(refused(20.0, 30.0, 40.0, off=NOISY))
    assert (one.title, one.severity) == ("Auto was refused to the end: requires position", "critical")
    assert one.parameters == ("EK3_VELNE_M_NSE",)
    assert one.evidence == "3 refusals, and it was never in Auto; EK3_VELNE_M_NSE is 5 (default 0.5)"


@pytest.mark.parametrize(
    ("times", "why", "severity"),
    [((20.0,), "requires position", "warning"), ((20.0, 40.0), "no mission", "critical")],
)
def test_no_parameter_is_named_where_none_is_off_or_none_is_read(
    times: tuple[float, ...], why: str, severity: str
) -> None:
    (one,) = found(refused(*times, why=why, off=None if "position" in why else NOISY))
    assert (one.severity, one.parameters) == (severity, ())


def test_a_mission_that_was_flown_was_not_refused() -> None:
    made = refused(20.0, 40.0)
    made.rows["MODE"].append((60.0, {"ModeNum": AUTO}))
    assert found(made) == []
    assert found(refused(20.0, 40.0, mode=LOITER)) == []
