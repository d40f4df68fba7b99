"""Tables of runs that are kept: each fits its profile, and holds the runs that its model was learned from."""

from __future__ import annotations

import pytest

from benchmarks.tools.train_profiles import SOURCES, TABLES
from care_core.files import bundled
from care_core.learn.table import read_table
from care_core.profile.store import load_profile

KEPT = [name for name, source in SOURCES.items() if source.table]


@pytest.mark.parametrize("name", KEPT)
def test_a_kept_table_is_what_the_profile_was_learned_from(name: str) -> None:
    profile = load_profile(bundled("profiles", name))
    frame = read_table(TABLES / SOURCES[name].table, profile.schema)
    assert len(frame) == profile.model.training.runs
    for option in profile.schema.options:
        assert frame[option.name].notna().all()


def test_every_table_that_is_kept_belongs_to_a_profile() -> None:
    assert sorted(path.name for path in TABLES.iterdir()) == sorted(SOURCES[name].table for name in KEPT)
