"""A robot on Nav2 whose recording holds no parameter: its messages, or a file, say which controller drove."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from care_core import Request, triage
from care_core.ecosystems.ros.node_messages import LogMessage
from care_core.ecosystems.ros.plugin_names import created
from care_core.files import bundled

SAMPLE = bundled("samples", "nav2_mppi_failed.mcap")
FILE = """
/**:
  ros__parameters:
    use_sim_time: true
controller_server:
  ros__parameters:
    controller_plugins: [Fast]
    Fast:
      plugin: nav2_mppi_controller::MPPIController
      GoalCritic: {cost_weight: 0.5252}
"""


def without(topics: Collection[str], path: Path) -> Path:
    """The sample without some of its topics."""
    with SAMPLE.open("rb") as source, path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        schemas: dict[int, int] = {}
        channels: dict[int, int] = {}
        for schema, channel, message in make_reader(source).iter_messages():
            if channel.topic in topics or schema is None:
                continue
            if schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            if channel.id not in channels:
                kind = schemas[schema.id]
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, kind)
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def test_what_the_controller_server_says_of_itself_chooses_the_profile(tmp_path: Path) -> None:
    report = triage(without({"/parameter_events"}, tmp_path / "a.mcap")).diagnosis
    assert report.profile.name == "nav2-mppi"
    assert report.fix is None
    assert report.abstained is not None
    assert report.abstained.startswith("not one of the parameters")
    assert report.tell_more[0].startswith("triage the log again with '--config FILE'")
    assert (report.hypotheses[0].what, report.hypotheses[0].name) == ("parameter", "")


def test_a_file_says_which_controller_drove_and_what_it_is_called(tmp_path: Path) -> None:
    log = without({"/parameter_events", "/rosout"}, tmp_path / "a.mcap")
    unsaid = triage(log).diagnosis.profile
    assert any(reason.startswith("nothing says that it drove with") for reason in unsaid.fit.reasons)
    (tmp_path / "nav2.yaml").write_text(FILE)
    report = triage(Request(log, configs=(tmp_path / "nav2.yaml",))).diagnosis
    assert report.profile.name == "nav2-mppi"
    assert report.run.config["goal_weight"] == pytest.approx(0.5252)
    assert report.run.sources["goal_weight"].startswith(str(tmp_path / "nav2.yaml:"))


def said(node: str, text: str) -> LogMessage:
    return LogMessage(0.0, 2, node, text)


def test_the_controller_behind_a_rotation_shim_is_said_as_well() -> None:
    rpp = "nav2_regulated_pure_pursuit_controller::RegulatedPurePursuitController"
    told = created([said("controller_server", f"Created internal controller for rotation shimming: X of type {rpp}")])
    assert {name: one.value for name, (one,) in told.items()} == {"/controller_server.X.primary_controller": rpp}


@pytest.mark.parametrize(
    ("made", "list"),
    [
        ("controller : X of type dwb_core::DWBLocalPlanner", "controller_plugins"),
        ("global planner plugin X of type nav2_navfn_planner/NavfnPlanner", "planner_plugins"),
        ("goal checker : X of type nav2_controller::StoppedGoalChecker", "goal_checker_plugins"),
        ("progress_checker : X of type nav2_controller::PoseProgressChecker", "progress_checker_plugins"),
    ],
)
def test_servers_say_what_they_made(made: str, list: str) -> None:
    told = created([said("robot1.server", f"Created {made}"), said("x", "Creating controller server"), said("x", "")])
    assert {name: one.value for name, (one,) in told.items()} == {
        "/robot1/server.X.plugin": made.rpartition(" ")[2],
        f"/robot1/server.{list}": "X",
    }
