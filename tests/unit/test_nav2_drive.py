"""The robot driven by Nav2 itself, where it is installed and its setup file sourced."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from nav2_robot.__main__ import main

START = Path(__file__).parents[2] / "samples" / "nav2_robot" / "start" / "dwb.yaml"


def test_nav2_reaches_the_goals_and_the_drive_is_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("rclpy", reason="needs ROS 2")
    pytest.importorskip("nav2_msgs.action", reason="needs Nav2")
    from mcap.reader import make_reader

    monkeypatch.setenv("ROS_DOMAIN_ID", os.environ.get("ROS_DOMAIN_ID", "42"))
    truth = tmp_path / "truth.json"
    words = ["--params", str(START), "--logs", str(tmp_path), "--seed", "2", "--truth", str(truth)]
    assert main(words) == 0
    told = json.loads(truth.read_text())
    goals = len(told["world"]["goals"])
    assert told["results"] == [4] * goals
    assert told["collisions"] == 0
    with (tmp_path / "drive.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    counts = {summary.channels[n].topic: many for n, many in summary.statistics.channel_message_counts.items()}
    assert counts["/odom"] > told["mission_s"] * 10
    assert counts["/plan"] >= goals
    assert counts["/parameter_events"] >= len(("controller", "planner", "behaviors", "navigator", "smoother"))
