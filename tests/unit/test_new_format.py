"""A new log format is a reader and one row: everything else, from the file's name to the triage, follows the row."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
import pytest

from care_core.configs.formats import format_for
from care_core.ecosystems.px4.dialect import QGC_PARAMS
from care_core.ecosystems.registry import ecosystem_of
from care_core.errors import ProfileError
from care_core.logs import formats
from care_core.logs.base import Channel, Table, Wanted
from care_core.logs.finding import find_logs
from care_core.logs.formats import LogFormat
from care_core.logs.opening import open_log
from care_core.profile.reading import read_schema
from care_core.run import Damage, Setting
from tests.conftest import Care

MAGIC = b"JSONLOG\n"


class JsonLog:
    """The reader of a made format: PX4's topics as JSON, time and fields by topic."""

    def __init__(self, path: Path) -> None:
        self.path, self.format = path, MADE
        self.start: str | None = None
        self.damage: tuple[Damage, ...] = ()
        self.facts: Mapping[str, str] = {"stack": "PX4", "firmware": "PX4 v1.15.0", "vehicle": "multicopter"}
        self._topics: Mapping[str, Mapping[str, list[float]]] = json.loads(path.read_bytes().removeprefix(MAGIC))
        self.duration_s = max(columns["t"][-1] for columns in self._topics.values())

    def channels(self) -> tuple[Channel, ...]:
        return tuple(Channel(name, name, len(columns["t"])) for name, columns in self._topics.items())

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return {"MPC_XY_VEL_MAX": (Setting("MPC_XY_VEL_MAX", 12.0, "the log"),)}

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        return {name: self._table(name, fields) for name, fields in wanted.items() if name in self._topics}

    def _table(self, name: str, fields: Iterable[str]) -> Table:
        columns = {field: np.array(values, np.float64) for field, values in self._topics[name].items()}
        return Table(columns["t"], {field: columns[field] for field in fields if field in columns})


MADE = LogFormat(
    name="json-log",
    title="JSON logs",
    ecosystem="px4",
    reader=(__name__, "JsonLog"),
    suffixes=(".jlog",),
    magic=MAGIC,
)


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A flight of a minute whose motor fails, in a format that the program knows by its row."""
    monkeypatch.setattr(formats, "FORMATS", (*formats.FORMATS, MADE))
    t = np.arange(0.0, 60.0, 0.5)
    topics = {
        "vehicle_status": {"arming_state": np.where((t >= 10) & (t < 50), 2.0, 1.0), "nav_state": np.full(len(t), 2.0)},
        "failsafe_flags": {"fd_motor_failure": (t >= 35).astype(float)},
    }
    tables = {name: {"t": t.tolist(), **{f: v.tolist() for f, v in part.items()}} for name, part in topics.items()}
    path = tmp_path / "flight.jlog"
    path.write_bytes(MAGIC + json.dumps(tables).encode())
    return path


def test_a_row_opens_a_log_and_finds_it_in_folders(log: Path) -> None:
    assert open_log(log).format is MADE
    assert find_logs([log.parent]) == (log,)
    assert "JSON logs (.jlog)" in formats.readable()


def test_a_row_names_the_ecosystem_and_so_its_dialect(log: Path) -> None:
    assert ecosystem_of(MADE).name == "px4"
    assert MADE in ecosystem_of(MADE).formats
    assert format_for(MADE.name) is QGC_PARAMS


def test_inspect_and_params_show_a_log_of_it(log: Path, care: Care) -> None:
    inspected = care("inspect", str(log), "--json")
    assert json.loads(inspected.stdout)["log"]["format"] == "json-log"
    assert "MPC_XY_VEL_MAX\t12" in care("params", str(log)).stdout


def test_a_triage_of_it_finds_what_failed(log: Path, care: Care) -> None:
    outcome = care("triage", str(log), "--json")
    document = json.loads(outcome.stdout)
    assert outcome.code == 1
    assert document["log"]["format"] == "json-log"
    assert [finding["kind"] for finding in document["findings"]] == ["motor"]


def test_a_profile_may_name_it(log: Path, tmp_path: Path) -> None:
    text = (
        "schema_version: 1\nname: made\nversion: '1'\nplatform: made\nlogs: [FORMAT]\nmission: {kind: px4_flight}\n"
        "variables:\n  gain: {role: option, type: float, range: [0, 1], default: 0.5, parameter: MC_ROLL_P}\n"
        "  time: {role: objective, unit: s, kind: functional, threshold: {op: '<=', value: 60}, "
        "extract: {kind: recorded_time}}\n"
    )
    path = tmp_path / "profile.yaml"
    path.write_text(text.replace("FORMAT", "json-log"), encoding="utf-8")
    assert read_schema(path).logs == ("json-log",)
    path.write_text(text.replace("FORMAT", "json-lag"), encoding="utf-8")
    with pytest.raises(ProfileError, match="json-log"):
        read_schema(path)
