"""What goes to strangers: nothing of a log that plants names, hosts, serial numbers, paths, positions and dates."""

from __future__ import annotations

import json
import zipfile
from io import BytesIO
from pathlib import Path

import pytest

import care_core
from care_core.application.bundling import bundle_of
from care_core.application.case import Case
from care_core.application.redaction import HIDDEN, NO_PLACE, Redactor, without_places
from care_core.application.sharing import Sharing
from care_core.files import bundled
from care_core.report.formats import FORMATS
from tests.goal_drives import drive
from tests.rewritten import write_text

SAMPLE = bundled("samples", "arducopter_failed.BIN")
PLANTED = {
    "a name": "PreArm: Zelda Quimby says wait",
    "a host": "PreArm: fieldlaptop-zq7 lost",
    "a serial number": "CubeOrange 0036003A 3133510B",
    "a path": "Arm: /home/zquimby/missions/orchard.waypoints",
    "coordinates": "PreArm: home at 47.3977421, 8.5455938",
    "a position": "Arm: pad (12.5, -3.75) occupied",
    "raw coordinates": "PreArm: lat 473977421 lng 85455938",
    "a date": "PreArm: RTC 2026-11-12 14:05:33",
    "a date in words": "Arm: since 12 November 2026",
    "an address": "PreArm: link 10.11.12.13:14550 down",
    "mail": "PreArm: ask zelda.quimby@example.com",
    "MAC": "Arm: radio aa:bb:cc:dd:ee:0f",
}
SECRETS = (
    "zelda", "quimby", "zquimby", "fieldlaptop", "zq7", "0036003a", "3133510b", "orchard", "47.39", "8.5455",
    "473977421", "12.5, -3.75", "2026-11-12", "14:05:33", "november", "10.11.12.13", "example.com", "aa:bb:cc",
    "heron9000", "kestrel", "8675309",
)  # fmt: skip


@pytest.fixture(scope="module")
def planted(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """A flight whose log names its owner, computer, board, place and day."""
    folder = tmp_path_factory.mktemp("heron9000")
    path = write_text(folder / "kestrel_zelda.log", SAMPLE)
    lines = path.read_text(encoding="utf-8").splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("ARM, "))
    time_s = float(lines[at].split(", ")[1])
    said = [f"MSG, {time_s}, {text}" for text in PLANTED.values()]
    number = next(line for line in lines if line.startswith("PARM, ")).split(", ")
    serial = ", ".join((*number[:2], "BRD_SERIAL_NUM", "8675309", *number[4:]))
    place = ", ".join((*number[:2], "SIM_OPOS_LAT", "47.3977421", *number[4:]))
    path.write_text("\n".join([*lines[:at], serial, place, *said, *lines[at:]]) + "\n", encoding="utf-8")
    return care_core.triage(path)


def found_in(text: str) -> list[str]:
    return [secret for secret in SECRETS if secret in text.casefold()]


def test_what_is_planted_is_in_the_log_and_in_the_document(planted: Case) -> None:
    everything = planted.report("json")
    assert {"zelda", "quimby", "zq7", "heron9000", "kestrel"} <= set(found_in(everything))


@pytest.mark.parametrize("format", FORMATS)
def test_an_anonymous_report_holds_nothing_of_it(planted: Case, format: str) -> None:
    report = planted.report(format, Sharing(positions=False, anonymous=True))
    assert found_in(report) == []
    assert planted.diagnosis.run.log.sha256 not in report
    if format != "patch":
        assert "LAND_SPEED" in report, "the answer stays"
    if format == "json":
        assert json.loads(report)["log"]["start"] is None


def test_an_anonymous_bundle_holds_nothing_of_it(planted: Case) -> None:
    bundle = bundle_of(planted, Sharing(positions=False, anonymous=True), "0")
    with zipfile.ZipFile(BytesIO(bundle.content)) as archive:
        for name in archive.namelist():
            assert found_in(archive.read(name).decode()) == [], name
        assert "LAND_SPEED,16" in archive.read("care-bundle/parameters.param").decode()
        assert archive.read("care-bundle/messages.csv").decode().count("text left out") >= len(PLANTED) - 3


@pytest.mark.parametrize("format", ["markdown", "html", "junit"])
def test_reports_that_are_sent_have_no_positions_unless_asked_for(planted: Case, format: str) -> None:
    usual = planted.report(format)
    assert not {"47.39", "473977421", "12.5, -3.75"} & set(found_in(usual))
    asked = planted.report(format, Sharing(positions=True))
    assert "47.39" in asked or "12.5, -3.75" in asked
    assert "zelda" in usual.casefold(), "names stay unless anonymous"


def test_goals_have_no_places_in_a_post(tmp_path: Path) -> None:
    case = care_core.triage(drive(tmp_path / "a.bag", [(3.0, 0.5), (5.25, 0.5)]))
    post = case.report("markdown")
    assert f"goal 1 at {NO_PLACE}" in post
    assert "(3.0, 0.5)" not in post
    assert "goal 1 at (3.0, 0.5)" in case.report("markdown", Sharing(positions=True))
    assert "goal 1 at (3.0, 0.5)" in case.report("json")


def test_the_programs_own_words_are_all_public() -> None:
    for name in ("arducopter_failed.BIN", "arducopter_motor.BIN", "ardurover_failed.BIN", "move_base_drive.bag"):
        report = care_core.triage(bundled("samples", name)).report("markdown", Sharing(anonymous=True))
        hidden = [line for line in report.splitlines() if HIDDEN in line and not line.startswith("Log ")]
        assert hidden == [], name


@pytest.mark.parametrize(
    "text",
    [
        "at (4.2, 0.1)", "-35.3632621,149.1652374", "lat: -35.36 lng: 149.16", "lat 473977421", "x=4.2", "47.39774 N",
        "4723.8645,N", "47\N{DEGREE SIGN} 23' 51\" N", "32TMT6512045", "(1.0, 2.0, 3.0)",
    ],
)  # fmt: skip
def test_places_are_known_by_their_shape(text: str) -> None:
    kept = without_places(text)
    assert NO_PLACE in kept
    assert not set("123456789") & set(kept.replace(NO_PLACE, "").replace("51", ""))


@pytest.mark.parametrize(
    "text",
    ["1.3 x the 114 s", "10.8 V at 34 A", "0.001125 to 0.003", "items 2 to 7 until 91 s", "V4.5.4", "12:05", "in 97%"],
)
def test_what_only_looks_like_a_place_stays(text: str) -> None:
    assert without_places(text) == text
    assert HIDDEN not in Redactor(frozenset(("the", "at", "to", "items", "until", "in"))).text(text)
