"""`care bundle`: what an expert needs, below 2 MB, whatever the log; the log stays untouched."""

from __future__ import annotations

import csv
import hashlib
import json
import shutil
import zipfile
from io import BytesIO, StringIO
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import jsonschema
import numpy as np
import pytest

import care_core
from care_core.application import bundling
from care_core.application.bundling import LARGEST, bundle_of
from care_core.application.case import Case
from care_core.application.sharing import Sharing
from care_core.application.signals import signals_of
from care_core.files import bundled
from care_core.outputs import write_binary
from care_core.report.document import TriageDocument
from tests.conftest import Care

SAMPLE = bundled("samples", "arducopter_motor.BIN")
DRIVE = bundled("samples", "move_base_drive.bag")
SAFE = Sharing(positions=False)


@pytest.fixture(scope="module")
def case() -> Case:
    return care_core.triage(SAMPLE)


def files_of(content: bytes) -> dict[str, str]:
    with zipfile.ZipFile(BytesIO(content)) as archive:
        assert archive.testzip() is None
        return {name.removeprefix("care-bundle/"): archive.read(name).decode() for name in archive.namelist()}


def test_it_holds_reports_parameters_signals_messages_versions_and_what_is_missing(case: Case) -> None:
    bundle = bundle_of(case, SAFE, "1.2.3")
    files = files_of(bundle.content)
    assert len(bundle.content) < 500_000
    assert next(iter(files)) == "README.txt"
    assert set(files) == set(bundle.files)
    document = json.loads(files["report.json"])
    jsonschema.validate(document, TriageDocument.json_schema())
    assert document["log"]["path"] == SAMPLE.name, "no folder of this computer"
    assert files["report.html"].startswith("<!doctype html>")
    assert files["report.md"].startswith("# Triage of")
    settings = dict(line.split(",") for line in files["parameters.param"].split())
    assert float(settings["BATT_LOW_VOLT"]) == 10.5
    assert "care 1.2.3" in files["versions.txt"]
    assert "ArduCopter V4.5.4" in files["versions.txt"]
    assert "mission_time: not evaluated" in files["README.txt"]
    assert "Battery 1 is low" in files["messages.csv"]


def test_signals_are_the_logs_own_numbers(case: Case) -> None:
    rows = list(csv.DictReader(StringIO(files_of(bundle_of(case, SAFE, "0").content)["signals/RCOU.csv"])))
    assert case.log is not None
    table = case.log.read({"RCOU": ("C4",)})["RCOU"]
    assert len(rows) == len(table)
    assert np.allclose([float(row["C4"]) for row in rows], table["C4"])
    assert np.allclose([float(row["time_s"]) for row in rows], table.t, atol=5e-4)


def test_positions_stay_at_home_unless_asked_for(case: Case) -> None:
    safe, asked = (files_of(bundle_of(case, sharing, "0").content) for sharing in (SAFE, Sharing(positions=True)))
    assert "Lat" not in safe["signals/POS.csv"].partition("\n")[0]
    assert "Lat,Lng" in asked["signals/POS.csv"].partition("\n")[0]
    told = [text for name, text in safe.items() if not name.startswith("signals/")]
    assert not [text for text in told if "-35.36" in text or "149.16" in text]
    assert "COMPASS_DEC," not in safe["parameters.param"]
    assert "COMPASS_DEC," in asked["parameters.param"] or "COMPASS_DEC" not in case.diagnosis.run.settings


def test_a_drive_has_no_place_on_its_map() -> None:
    files = files_of(bundle_of(care_core.triage(DRIVE), SAFE, "0").content)
    assert files["signals/odom.csv"].startswith("time_s,twist.twist.linear.x,twist.twist.angular.z\n")
    assert "max_vel_trans" in files["parameters.yaml"]
    document = json.loads(files["report.json"])
    assert not [one["text"] for one in document["account"] if "(4.2, 0.1)" in one["text"]]


def test_the_same_run_gives_the_same_bundle(case: Case) -> None:
    assert bundle_of(case, SAFE, "0").content == bundle_of(case, SAFE, "0").content


def test_signals_are_thinned_to_the_room_there_is_and_that_is_said(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = bundle_of(case, SAFE, "0")
    monkeypatch.setattr(bundling, "LARGEST", 130_000)
    monkeypatch.setattr(bundling, "_ROWS", (1_000_000, 50))
    small = bundle_of(case, SAFE, "0")
    assert len(small.content) <= 130_000 < len(whole.content) <= LARGEST
    assert "at most 50 values each" in files_of(small.content)["README.txt"]
    rows = list(csv.DictReader(StringIO(files_of(small.content)["signals/RCOU.csv"])))
    assert case.log is not None
    table = case.log.read({"RCOU": ("C4",)})["RCOU"]
    kept = [float(row["C4"]) for row in rows if row["C4"]]
    assert (min(kept), max(kept)) == (table["C4"].min(), table["C4"].max())


def test_a_log_without_signals_or_parameters_is_bundled_too(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    assert case.log is not None
    path, format, duration = case.log.path, case.log.format, case.log.duration_s
    empty = SimpleNamespace(path=path, format=format, duration_s=duration, damage=(), start=None, facts={},
                            channels=lambda: (), settings=dict, read=lambda _wanted: {})  # fmt: skip
    bare = Case(case.diagnosis, log=cast("care_core.logs.base.Log", empty))
    assert signals_of(bare) == []
    files = files_of(bundle_of(bare, SAFE, "0").content)
    assert "parameters: the log holds none" in files["README.txt"]
    assert not [name for name in files if name.startswith("signals/")]


def test_the_command_writes_beside_the_operator_and_leaves_the_log(
    care: Care, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    log = tmp_path / "a.BIN"
    shutil.copy(SAMPLE, log)
    before = hashlib.sha256(log.read_bytes()).hexdigest()
    ended = care("bundle", "a.BIN")
    assert ended.code == 0
    assert "report.html" in ended.stdout
    assert "without positions" in ended.stderr
    assert hashlib.sha256(log.read_bytes()).hexdigest() == before
    assert care("bundle", "a.BIN").code == 0, "a bundle may be made again"
    assert "README.txt" in files_of((tmp_path / "a.care.zip").read_bytes())
    assert care("bundle", "a.BIN", "-o", "a.BIN").code == 2
    assert hashlib.sha256(log.read_bytes()).hexdigest() == before


def test_only_a_bundle_is_replaced(tmp_path: Path) -> None:
    made = bundling._packed({"README.txt": "x"})
    target = tmp_path / "a.zip"
    write_binary(target, made, "bundle")
    write_binary(target, made, "bundle")
    with zipfile.ZipFile(target, "w") as archive:
        archive.writestr("holiday.jpg", "precious")
    precious = target.read_bytes()
    with pytest.raises(care_core.errors.UsageError, match="never overwritten"):
        write_binary(target, made, "bundle", force=True)
    assert target.read_bytes() == precious
    target.write_text("notes")
    with pytest.raises(care_core.errors.UsageError, match="another kind"):
        write_binary(target, made, "bundle")
    write_binary(target, made, "bundle", force=True)
    assert target.read_bytes() == made
    assert [path.name for path in tmp_path.iterdir() if path.is_file()] == ["a.zip"]
