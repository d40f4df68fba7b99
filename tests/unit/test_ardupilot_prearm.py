"""Refusals to arm."""

from __future__ import annotations

import pytest

from tests.flights import Made, first


def test_a_refusal_is_told_by_its_words() -> None:
    made = Made()
    del made.rows["ARM"]
    made.table["CTUN"]["ThO"][:] = 0.0
    words = ["Arm: Gyros inconsistent"] * 3 + ["Arm: Check ANGLE_MAX"] * 20
    made.rows["MSG"] = [(5.0 * n, {"Message": text}) for n, text in enumerate(words)]
    finding = first(made)
    assert (finding.kind, finding.title) == ("prearm", "arming was refused: Check ANGLE_MAX")


@pytest.mark.parametrize(
    ("text", "suspect"),
    [
        ("PreArm: RC not calibrated", "operation"),
        ("Arm: RTL mode not armable", "operation"),
        ("Arm: Throttle too high", "operation"),
        ("PreArm: Check ANGLE_MAX", "parameter"),
        ("PreArm: Need Position Estimate", "parameter"),
    ],
)
def test_a_refusal_for_what_an_operator_has_to_do_is_no_parameters(text: str, suspect: str) -> None:
    made = Made()
    del made.rows["ARM"]
    made.table["CTUN"]["ThO"][:] = 0.0
    made.rows["MSG"] = [(20.0, {"Message": text}), (50.0, {"Message": text})]
    (finding,) = [one for one in made.find() if one.kind == "prearm"]
    assert finding.suspect == suspect
    assert (finding.probability > 0.9) == (suspect == "operation")


@pytest.mark.parametrize(("channel", "named"), [(8.0, ("RCMAP_THROTTLE",)), (3.0, ())])
def test_a_stick_on_another_channel_is_named_that_nobody_can_centre(channel: float, named: tuple[str, ...]) -> None:
    made = Made()
    del made.rows["ARM"]
    made.table["CTUN"]["ThO"][:] = 0.0
    made.settings["RCMAP_THROTTLE"] = channel
    text = f"Arm: Throttle (RC{channel:g}) is not neutral"
    made.rows["MSG"] = [(20.0, {"Message": text}), (50.0, {"Message": text})]
    (finding,) = [one for one in made.find() if one.kind == "prearm"]
    assert finding.parameters == named
