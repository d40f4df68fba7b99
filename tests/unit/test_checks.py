"""The list of health checks is that of the code, and every limit says where it comes from."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import pytest

from care_core.ecosystems.base import Check, Ecosystem
from care_core.ecosystems.registry import ecosystems
from care_core.report.checks import checks_text, document
from tests.conftest import Care

PAGE = Path(__file__).resolve().parents[2] / "docs" / "checks.md"
CHECKS = [(ecosystem, check) for ecosystem in ecosystems() for check in ecosystem.checks()]


def test_the_committed_page_is_up_to_date() -> None:
    assert PAGE.read_text(encoding="utf-8") == document(), "run: make docs"


@pytest.mark.parametrize("ecosystem", ecosystems(), ids=lambda one: one.name)
def test_the_checks_of_an_ecosystem_have_names_of_their_own(ecosystem: Ecosystem) -> None:
    names = [check.name for check in ecosystem.checks()]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize(("ecosystem", "check"), CHECKS, ids=[f"{e.name}-{c.name}" for e, c in CHECKS])
def test_a_check_says_what_it_looks_for_and_limits_whence(ecosystem: Ecosystem, check: Check[Any]) -> None:
    assert check.looks_for
    assert not check.looks_for.endswith(".")
    names = [limit.name for limit in check.limits]
    assert len(set(names)) == len(names)
    for limit in check.limits:
        assert limit.source, limit.name
        assert not re.match(r"a choice(?!: \w)", limit.source), f"{limit.name}: why so?"
        assert math.isfinite(limit.value), limit.name


def test_the_command_lists_the_checks_and_explains_their_limits(care: Care) -> None:
    brief, explained = care("checks"), care("checks", "--explain")
    assert (brief.code, explained.code) == (0, 0)
    assert "estimator" in brief.stdout
    assert "innovation test ratio" not in brief.stdout
    assert "innovation test ratio: 1 (EstimatorStatus.msg" in explained.stdout
    assert "shortest rejection: 1 s (" in explained.stdout
    assert all(len(line) <= 80 for line in explained.stdout.splitlines())


@pytest.mark.parametrize("explain", [False, True])
def test_every_check_is_in_the_text(*, explain: bool) -> None:
    text = checks_text(explain=explain)
    for ecosystem, check in CHECKS:
        assert ecosystem.title in text
        assert f"  {check.name} " in text
