"""`care inspect`: the document is the published one, and says what each profile would miss."""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path

import pytest

import care_core
from care_core.application.case import Request
from care_core.application.viewing import what_would_fit
from care_core.files import bundled
from tests.conftest import Care
from tests.ros_samples import write_db3

DATA = Path(__file__).parents[1] / "data"
FLIGHT, DRIVE = DATA / "arducopter_good.BIN", DATA / "move_base_good.bag"


@pytest.mark.parametrize(("log", "profile"), [(FLIGHT, "arducopter"), (DRIVE, "move_base")])
def test_the_document_follows_its_schema(care: Care, log: Path, profile: str) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    document = json.loads(care("inspect", log, "--json").stdout)
    jsonschema.validate(document, json.loads(care("schema", "inspect").stdout))
    assert document["schema"] == "care.inspect/1"
    best, *others = document["profiles"]
    assert (best["name"], best["usable"], best["missed"]) == (profile, True, [])
    assert best["options"] == best["options_wanted"] > 0
    assert len(best["missions"]) == 1
    assert others
    assert all(other["usable"] or other["reason"] for other in others)
    assert document["log"]["read"]["about_s"] == document["log"]["duration_s"]


def test_a_cut_log_says_how_much_of_it_was_read(care: Care, tmp_path: Path) -> None:
    cut = tmp_path / "cut.BIN"
    raw = FLIGHT.read_bytes()
    cut.write_bytes(raw[: len(raw) // 2 + 1] + bytes(len(raw) // 2))
    outcome = care("inspect", cut)
    assert outcome.code == 0
    (span,) = [line for line in outcome.stdout.splitlines() if line.startswith("Duration")]
    assert "read to " in span
    (damage,) = [line for line in outcome.stdout.splitlines() if line.startswith("Damage")]
    assert "at byte" in damage


def test_many_damaged_places_are_folded(care: Care, tmp_path: Path) -> None:
    holed = bytearray(FLIGHT.read_bytes())
    for place in range(50_000, len(holed), 5_000):
        holed[place : place + 40] = bytes(40)
    log = tmp_path / "holed.BIN"
    log.write_bytes(holed)
    shown = [line for line in care("inspect", log).stdout.splitlines() if line.startswith("Damage")]
    assert len(shown) < 8
    assert any("damaged places, the first" in line for line in shown)


def test_what_was_not_recorded_is_named_with_how_to_record_it(care: Care, tmp_path: Path) -> None:
    from rosbags.rosbag1 import Reader, Writer

    log = tmp_path / "thin.bag"
    with Reader(DRIVE) as bag, Writer(log) as writer:
        kept = [c for c in bag.connections if c.topic != "/battery_state" and "DWAPlannerROS" not in c.topic]
        made = {c.id: writer.add_connection(c.topic, c.msgtype, msgdef=c.msgdef.data, md5sum=c.digest) for c in kept}
        for connection, time_ns, raw in bag.messages(kept):
            writer.write(made[connection.id], time_ns, raw)
    best = json.loads(care("inspect", log, "--json").stdout)["profiles"][0]
    assert (best["name"], best["usable"]) == ("move_base", True)
    missed = {entry["name"]: entry for entry in best["missed"]}
    assert "/battery_state" in missed["energy"]["hint"]
    assert "/move_base/DWAPlannerROS/parameter_updates" in missed["occdist_scale"]["hint"]
    assert best["options"] == best["options_wanted"] - sum(entry["role"] == "option" for entry in missed.values())
    assert "misses    objective energy" in care("inspect", log).stdout


def test_a_log_without_messages_is_still_looked_into(care: Care, recorded: Path) -> None:
    outcome = care("inspect", recorded / "logs" / "ros1_bag" / "no_messages.bag")
    assert outcome.code == 0
    assert "Parameters  0" in outcome.stdout


def test_an_encoding_of_escapes_reaches_no_terminal(care: Care, tmp_path: Path) -> None:
    path = write_db3(tmp_path / "bag")
    database = sqlite3.connect(path)
    with database:
        database.execute("update topics set serialization_format = ?", ("\x1b]52;c;aGk=\x07",))
    database.close()
    (path.parent / "metadata.yaml").unlink(missing_ok=True)
    for flags in ((), ("--json",)):
        assert "\x1b" not in care("inspect", path, *flags).stdout


def test_what_would_make_a_profile_fit_is_told_of_the_profile_that_is_said_not_to() -> None:
    """Another may have more of the log."""
    case = care_core.triage(Request(bundled("samples", "nav2_mppi_failed.mcap"), "nav2"))
    assert case.diagnosis.profile.fit.verdict == "no"
    *told, own = what_would_fit(case)
    assert told
    assert all(one.startswith("for nav2: ") for one in told)
    assert own.startswith("a profile of its own")
