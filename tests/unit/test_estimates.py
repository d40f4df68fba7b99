"""Every number behind the odds says where it is from, and the page says what the code has."""

from __future__ import annotations

from pathlib import Path

import pytest

from care_core.diagnose.estimates import ESTIMATES, Estimate
from care_core.report.estimates import document

PAGE = Path(__file__).parents[2] / "docs" / "estimates.md"


@pytest.mark.parametrize("one", ESTIMATES, ids=lambda one: one.name[:30])
def test_a_number_says_where_it_is_from(one: Estimate) -> None:
    assert one.source
    assert one.value > 0.0


def test_the_page_says_what_the_code_has() -> None:
    assert PAGE.read_text(encoding="utf-8") == document(), "run 'make docs'"
