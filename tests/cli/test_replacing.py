"""What is written where a file is: only what this program wrote is replaced, links are not written through."""

from __future__ import annotations

from pathlib import Path

import pytest

from care_core.configs.formats import write_params
from care_core.ecosystems.ardupilot.dialect import ARDUPILOT_PARAM
from care_core.errors import ExitCode, UsageError
from care_core.files import bundled, read_small_bytes
from care_core.outputs import check_replaceable, kind_of, signed_parameters, write_output
from care_core.run import Setting
from care_core.tables import ingest as ingesting
from care_core.tables.ingest import failures_table
from care_core.tables.rows import ABOUT, write_rows
from tests.conftest import Care

pytestmark = pytest.mark.long

SAMPLE = bundled("samples", "arducopter_failed.BIN")
DRIVE = bundled("samples", "move_base_drive.bag")

STRANGERS = {
    "commented YAML": b"# our robot, tuned by hand\ncontroller_server:\n  ros__parameters:\n    max_vel_x: 0.26\n",
    "YAML": b"planner: {tolerance: 0.5}\n",
    "parameters": b"LAND_SPEED,50\nWPNAV_SPEED,500\n",
    "commented parameters": b"# tuned by hand\nLAND_SPEED 50\n",
    "JSON": b'{"robot": "rover"}\n',
    "JSON that names us": b'{"robot": "rover", "schema": "care.triage/1"}\n',
    "schema": b'{"$schema": "https://json-schema.org/draft/2020-12/schema"}\n',
    "page": b"<!doctype html>\n<html><head><title>Our robots</title></head></html>\n",
    "Markdown": b"# Triage of the week\n\nBuy batteries.\n",
    "patch": b"--- a/nav2_params.yaml\n+++ b/nav2_params.yaml\n@@ -1 +1 @@\n-a: 1\n+a: 2\n",
    "JUnit": b'<?xml version="1.0"?>\n<testsuites>\n  <testsuite name="pytest" tests="4"/>\n</testsuites>\n',
    "DOT": b"digraph robots {\n  a -> b;\n}\n",
    "GraphML": b'<?xml version="1.0"?>\n<graphml xmlns="http://graphml.graphdrawing.org/xmlns"/>\n',
    "table": b"log,mission,pilot\na.BIN,1,Ann\n",
    "text": b"Profile of the rover: heavy.\n",
    "text that quotes us": b"Written by care.\nI do not believe it.\n",
    "a recorder's zip": b"PK\x03\x04" + bytes(26) + b"holiday.jpg",
    "parquet": b"PAR1 care tables PAR1",
    "binary": b"\0\x01\x02",
    "one letter": b"x",
}
COMMANDS: dict[str, tuple[str, ...]] = {
    "report.json": ("triage", "LOG", "--no-history", "--out"),
    "report.yaml": ("triage", "LOG", "--no-history", "--out"),
    "report.md": ("triage", "LOG", "--no-history", "--out"),
    "report.html": ("triage", "LOG", "--no-history", "--out"),
    "report.xml": ("triage", "LOG", "--no-history", "--out"),
    "report.patch": ("triage", "LOG", "--no-history", "--out"),
    "report.txt": ("triage", "LOG", "--no-history", "--out"),
    "a.param": ("params", "LOG", "--out"),
    "whatif.txt": ("whatif", "LOG", "--set", "LAND_SPEED=40", "--out"),
    "whatif.json": ("whatif", "LOG", "--set", "LAND_SPEED=40", "--out"),
    "runs.csv": ("ingest", "LOG", "--profile", "arducopter", "-o"),
    "runs.parquet": ("ingest", "LOG", "--profile", "arducopter", "-o"),
    "lint.txt": ("lint", "PARAM", "--out"),
    "lint.json": ("lint", "PARAM", "--out"),
    "lint.sarif": ("lint", "PARAM", "--sarif", "--out"),
    "history.txt": ("history", "--out"),
    "history.json": ("history", "--out"),
    "history.csv": ("history", "--export"),
    "history.parquet": ("history", "--export"),
    "graph.txt": ("graph", "owlat", "--out"),
    "graph.json": ("graph", "owlat", "--out"),
    "graph.dot": ("graph", "owlat", "--out"),
    "graph.graphml": ("graph", "owlat", "--out"),
    "a.care.zip": ("bundle", "LOG", "--out"),
}


def words(name: str, folder: Path) -> list[str]:
    param = folder / "home" / "vehicle.param"
    param.write_text("LAND_SPEED,50\n\nLAND_SPEED,40\n")
    return [{"LOG": str(SAMPLE), "PARAM": str(param)}.get(word, word) for word in COMMANDS[name]]


@pytest.mark.parametrize("name", COMMANDS)
def test_each_output_replaces_its_like_and_no_strangers_file(care: Care, tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    command = [*words(name, tmp_path), path]
    path.write_bytes(STRANGERS["commented YAML"])
    code, _, err = care(*command)
    assert code == ExitCode.USAGE
    assert path.read_bytes() == STRANGERS["commented YAML"]
    assert "another kind" in err
    assert "--force" in err or "remove this one" in err
    path.write_bytes(b"")
    for _ in range(2):
        assert care(*command).code != ExitCode.USAGE, name
        assert kind_of(read_small_bytes(path)), name
    assert not [one.name for one in tmp_path.iterdir() if one.name not in ("home", name)]


@pytest.mark.parametrize("stranger", STRANGERS)
def test_no_strangers_file_is_of_a_kind_of_ours(tmp_path: Path, stranger: str) -> None:
    path = tmp_path / "file"
    path.write_bytes(STRANGERS[stranger])
    assert kind_of(STRANGERS[stranger]) == ""
    for kind in (
        "care.triage",
        "page",
        "Markdown",
        "JUnit",
        "patch",
        "parameters",
        "runs",
        "text",
        "bundle",
        "DOT",
        "GraphML",
    ):
        with pytest.raises(UsageError, match=r"another kind|never overwritten"):
            check_replaceable(path, kind=kind)
    with pytest.raises(UsageError):
        check_replaceable(path, b"anything")


@pytest.mark.parametrize("name", ["report.yaml", "runs.csv", "history.csv", "a.care.zip"])
@pytest.mark.parametrize("leads_to", ["a file", "nothing"])
def test_a_link_is_not_written_through(care: Care, tmp_path: Path, name: str, leads_to: str) -> None:
    target = tmp_path / "home" / "profile.sh"
    if leads_to == "a file":
        target.write_text("")
    (tmp_path / name).symlink_to(target)
    code, _, err = care(*words(name, tmp_path), tmp_path / name)
    assert code == ExitCode.USAGE
    assert "links are not written through" in err
    assert str(target) in err
    assert (tmp_path / name).is_symlink()
    assert not target.exists() or target.read_text() == ""


def test_what_is_written_already_is_no_strangers(tmp_path: Path) -> None:
    path = tmp_path / "vehicle.param"
    path.write_text("LAND_SPEED,40\n")
    write_output(path, "LAND_SPEED,40\n")
    with pytest.raises(UsageError, match="another kind"):
        write_output(path, "LAND_SPEED,50\n")
    write_output(path, "LAND_SPEED,50\n", force=True)


def test_a_report_does_not_replace_a_site_or_a_parameter_file(care: Care, tmp_path: Path) -> None:
    for name, content in {
        "site.yaml": "schema: care.site/1\nlimits: {}\n",
        "vehicle.yaml": signed_parameters("LAND_SPEED: 50\n"),
    }.items():
        (tmp_path / name).write_text(content)
        assert care("triage", SAMPLE, "--no-history", "--yaml", "--out", tmp_path / name).code == ExitCode.USAGE
        assert (tmp_path / name).read_text() == content


def test_a_parameter_file_is_signed_in_a_comment_of_every_dialect(care: Care, tmp_path: Path) -> None:
    for log in (SAMPLE, DRIVE):
        path = tmp_path / "params"
        assert care("params", log, "--out", path, "--force").code == ExitCode.OK
        assert path.read_text().startswith("# Written by care.\n")
        assert care("diff", path, log).code == ExitCode.OK
    written = write_params({"A": Setting("A", 1.0, "")}, ARDUPILOT_PARAM)
    assert kind_of(signed_parameters(written).encode()) == "parameters"


def test_the_journal_of_a_table_replaces_no_download(care: Care, tmp_path: Path) -> None:
    part = tmp_path / "runs.csv.part"
    part.write_text("half of a download\n")
    code, _, err = care("ingest", SAMPLE, "--profile", "arducopter", "-o", tmp_path / "runs.csv")
    assert (code, part.read_text()) == (ExitCode.USAGE, "half of a download\n"), err


@pytest.mark.parametrize("name", ["profile.yaml", "model.json", "MODEL_CARD.md", "mechanisms.npz"])
def test_no_profile_is_learned_over_files_of_somebodys_own(care: Care, tmp_path: Path, name: str) -> None:
    own = tmp_path / "rover"
    own.mkdir()
    (own / name).write_bytes(b"# mine\n")
    schema = bundled("profiles", "arducopter") / "profile.yaml"
    code, _, err = care("train", tmp_path / "none.csv", "--schema", schema, "-o", own)
    assert code == ExitCode.USAGE
    assert "Choose another --out" in err
    assert (own / name).read_bytes() == b"# mine\n"


def test_a_formula_in_a_log_is_text_in_every_table(tmp_path: Path) -> None:
    texts = ("=1+1", "+1", "-1", "@SUM(A1)", "\t=1", "\r=1", " =1", "\uff1d1")
    for text in texts:
        path = tmp_path / f"{texts.index(text)}.csv"
        write_rows(path, [{"log": text, "mission": -3.5, text: -1}], [*ABOUT, text], "runs")
        header, row = path.read_text().splitlines()
        assert header.split(",")[-1].strip('"').startswith("'")
        assert row.startswith("'")
        assert row.split(",")[1:] == ["-3.5", "", "", "", "-1"]
    from care_core.tables.ingest import Failure

    assert failures_table([Failure(Path("=a.BIN"), "=1+1")]) == "log,reason\n'=a.BIN,'=1+1\n"


def test_a_fleet_is_not_read_for_a_file_that_is_kept(care: Care, tmp_path: Path) -> None:
    path = tmp_path / "fleet.json"
    path.write_text('{"my": "notes"}\n')
    code, _, err = care("fleet", tmp_path / "nothing.BIN", "--out", path)
    assert (code, "another kind" in err) == (ExitCode.USAGE, True)


@pytest.mark.parametrize("line", ["[]", "5", '{"rows": []}', '{"log": "a"}', '{"log": [], "rows": 5}', "{"])
def test_a_journal_that_nobody_wrote_is_begun_anew(tmp_path: Path, line: str) -> None:
    path = tmp_path / "runs.csv.part"
    purpose = {"journal": "care.ingest/1"}
    path.write_text(f'{{"journal": "care.ingest/1"}}\n{line}\n')
    assert ingesting._read_journal(path, purpose) == {}
