"""A new ecosystem is one package and one line of the registry: logs of it are opened, examined and triaged."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from care_core.ecosystems import registry
from care_core.ecosystems.ardupilot.dialect import ARDUPILOT_PARAM
from care_core.ecosystems.base import Check, Ecosystem, Limits, RunModel
from care_core.ecosystems.dialect import Dialect
from care_core.ecosystems.dictionary import Dictionary, Field, Message
from care_core.ecosystems.findings import Event, Finding, Health
from care_core.logs import formats
from care_core.logs.base import Channel, Log, Table, Wanted
from care_core.logs.formats import LogFormat
from care_core.run import Damage, Robot, Setting
from tests.conftest import Care

TANK = {"TANK": ("Level",)}
LIMITS = Limits()
LOWEST = LIMITS.add("lowest level", 0.1, "", "a choice: the pump runs dry below")


class PumpLog:
    """A log of a made robot: the level of its tank, a number a line."""

    def __init__(self, path: Path) -> None:
        self.path, self.format = path, PUMP_LOG
        self.start: str | None = None
        self.damage: tuple[Damage, ...] = ()
        self.facts: Mapping[str, str] = {"robot": "pump 7"}
        self._levels = np.array(path.read_text(encoding="utf-8").split()[1:], np.float64)
        self.duration_s = float(len(self._levels) - 1)

    def channels(self) -> tuple[Channel, ...]:
        return (Channel("TANK", "TANK", len(self._levels)),)

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return {"PUMP_RATE": (Setting("PUMP_RATE", 3.0, "the log"),)}

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        t = np.arange(len(self._levels), dtype=np.float64)
        return {"TANK": Table(t, {"Level": self._levels})} if "TANK" in wanted else {}


def find(model: RunModel) -> Iterator[Finding]:
    table = model.tables(TANK)["TANK"]
    low = np.flatnonzero(table["Level"] < LOWEST)
    if len(low):
        yield Finding(
            kind="drive",
            title="the tank ran dry",
            onset_s=float(table.t[low[0]]),
            end_s=float(table.t[low[-1]]),
            severity="critical",
            evidence=f"below {LOWEST:g}",
            source="TANK.Level",
        )


class Pumps(Ecosystem):
    """Robots that pump."""

    name = "pumps"
    title = "Pumps"
    dialects = (ARDUPILOT_PARAM,)
    measures = ()

    def model(self, log: Log) -> RunModel:
        return RunModel(log)

    def examine(self, model: RunModel) -> Health:
        findings = tuple(finding for check in self.checks() for finding in check.find(model))
        return Health("a pump", (Event(0.0, "vehicle", "a pump", "TANK"),), findings)

    def log_messages(self, model: RunModel) -> Iterator[Event]:
        return iter(())

    def checks(self) -> tuple[Check[Any], ...]:
        return (Check("tank", "a tank that runs dry", TANK, LIMITS, find),)

    def missions(self, channels: tuple[Channel, ...]) -> Iterator[Mapping[str, Any]]:
        return iter(())

    def messages(self) -> Dictionary:
        return {"TANK": Message({"Level": Field(label="level of the tank", plausible=(0.0, 1.0))})}

    def dialect(self, format: LogFormat, parameters: Iterable[str]) -> Dialect:
        return ARDUPILOT_PARAM

    def robots(self, log: Log) -> Iterator[Robot]:
        return iter(())


ECOSYSTEM = Pumps()
PUMP_LOG = LogFormat("pump-log", "pump logs", "pumps", (__name__, "PumpLog"), (".pump",), b"PUMP\n")


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A log of a pump that ran dry after six seconds, and the program with its ecosystem registered."""
    monkeypatch.setattr(registry, "_PACKAGES", (*registry._PACKAGES, __name__))
    monkeypatch.setattr(formats, "FORMATS", (*formats.FORMATS, PUMP_LOG))
    registry.ecosystems.cache_clear()
    path = tmp_path / "today.pump"
    path.write_text("PUMP\n0.9\n0.8\n0.6\n0.5\n0.3\n0.2\n0.05\n0.05\n", encoding="utf-8")
    yield path
    registry.ecosystems.cache_clear()


def test_a_triage_finds_what_its_check_looks_for(log: Path, care: Care) -> None:
    outcome = care("triage", str(log), "--json")
    document = json.loads(outcome.stdout)
    assert outcome.code == 1
    assert [(found["title"], found["onset_s"]) for found in document["findings"]] == [("the tank ran dry", 6.0)]
    assert "pump 7" in care("triage", str(log)).stdout


def test_its_checks_and_limits_are_listed(log: Path, care: Care) -> None:
    listed = care("checks", "--explain").stdout
    assert "Pumps (1)\n  tank  a tank that runs dry\n" in listed
    assert "lowest level: 0.1 (a choice" in listed


def test_its_configuration_is_written_in_its_dialect(log: Path, care: Care) -> None:
    assert care("params", str(log)).stdout == "PUMP_RATE,3\n"


def test_a_log_of_it_is_inspected(log: Path, care: Care) -> None:
    assert json.loads(care("inspect", str(log), "--json").stdout)["log"]["format"] == "pump-log"
