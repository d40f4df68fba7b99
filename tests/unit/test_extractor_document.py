"""The page of extractors is that of the code, and every extractor says what it is and what it needs."""

from __future__ import annotations

from pathlib import Path

import pytest

from care_core.ecosystems.measures import EXTRACTORS, MISSION_KINDS, Mission
from care_core.ecosystems.registry import how_to_record
from care_core.report.extractors import document
from care_core.run import Unavailable
from tests.tables import no_model

PAGE = Path(__file__).resolve().parents[2] / "docs" / "extractors.md"


def test_the_committed_page_is_up_to_date() -> None:
    assert PAGE.read_text(encoding="utf-8") == document(), "run: make docs"


def test_every_extractor_and_mission_kind_is_documented() -> None:
    page = document()
    for name, extractor in EXTRACTORS.items():
        assert f"### `{name}`" in page
        assert extractor.doc
        assert all(extractor.args.values())
        assert extractor.parts or extractor.needs({}), f"{name} does not say what it reads"
    for name, kind in MISSION_KINDS.items():
        assert f"### `{name}`" in page
        assert all(kind.args.values())


@pytest.mark.parametrize("kind", ["actionlib_goals", "nav2_goals"])
def test_an_empty_log_never_gives_a_number_out_of_nothing(kind: str) -> None:
    counts = {"goals_sent", "goals_reached", "goals_ended", "goals_success", "goals_time", "recorded_time"}
    for name, extractor in EXTRACTORS.items():
        if not extractor.parts or name in counts:
            continue
        value = extractor.compute(
            Mission(no_model(), {}, 0.0, 10.0, ended=True, spec={"kind": kind}), {"index": 1, "how": "stuck"}
        )
        assert isinstance(value, Unavailable), name
        assert value.reason
        assert value.hint, f"{name}: {value.reason}"


@pytest.mark.parametrize(
    ("channel", "told"),
    [
        ("/odom", "rosbag record /odom, or ros2 bag record /odom"),
        ("/navigate_to_pose/_action/status", "--include-hidden-topics /navigate_to_pose/_action/status"),
        ("BAT", "'battery monitor' (512) in LOG_BITMASK"),
        ("BAT energy, or voltage with current", "LOG_BITMASK"),
        ("XYZ", "record XYZ"),
    ],
)
def test_how_to_record_a_channel(channel: str, told: str) -> None:
    assert told in how_to_record(channel)
