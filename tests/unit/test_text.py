"""Text of others in a table: nothing in it is computed by who opens it."""

from __future__ import annotations

import pytest

from care_core.text import cell


@pytest.mark.parametrize("text", ['=HYPERLINK("http://a","b")', "+1", "-1+1", "@SUM(A1)"])
def test_a_formula_is_text(text: str) -> None:
    assert cell(text) == f"'{text}"


@pytest.mark.parametrize(("text", "shown"), [("plain", "plain"), ("", ""), ("a=b", "a=b"), ("\x1b[0m", "\\x1b[0m")])
def test_what_is_none_stays(text: str, shown: str) -> None:
    assert cell(text) == shown
