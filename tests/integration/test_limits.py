"""The limit of a run does not follow the run: what no parameter explains is not what its mission needs."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from care_core.diagnose.judging import Judged, read_and_judge
from care_core.diagnose.records import ObjectiveResult
from care_core.ecosystems.registry import run_model
from care_core.files import bundled
from care_core.logs.dataflash import DataFlashLog
from care_core.logs.opening import open_log
from care_core.profile.store import load_profile
from tests import restamped

DATA = Path(__file__).parents[1] / "data"
GOOD, SLOW = DATA / "arducopter_good.BIN", bundled("samples", "arducopter_failed.BIN")
ROVER = bundled("samples", "ardurover_failed.BIN")


def judged(path: Path, profile: str = "arducopter") -> Judged:
    return judged_sample(path, profile) if path in (GOOD, SLOW, ROVER) else judged_anew(path, profile)


def judged_anew(path: Path, profile: str) -> Judged:
    return read_and_judge(run_model(open_log(path)), load_profile(profile))


judged_sample = cache(judged_anew)
"""The logs that stay as they are while the tests make others of them."""


def results(path: Path, profile: str = "arducopter") -> dict[str, ObjectiveResult]:
    return {result.name: result for result in judged(path, profile).results}


def limits(path: Path) -> dict[str, float]:
    found = results(path).items()
    return {name: one.threshold.bound for name, one in found if one.threshold is not None and one.need is not None}


def with_parameters(source: Path, change: Callable[[str], bool]) -> bytes:
    """A .BIN without the parameters that `change` names: their records say another name."""
    raw = bytearray(source.read_bytes())
    log = DataFlashLog(source)
    (form,) = log._formats["PARM"]
    at = form.fields["Name"].offset
    for start in log._offsets[form.type].tolist():
        name = bytes(raw[start + at : start + at + 16]).rstrip(b"\0").decode()
        if change(name):
            raw[start + at : start + at + 16] = b"LOST".ljust(16, b"\0")
    return bytes(raw)


def records(source: Path) -> Iterator[tuple[int, bytes, Any]]:
    """Stamp, bytes and format of every record of a .BIN in its order; one without a stamp has that before it."""
    raw, log, stamp = source.read_bytes(), DataFlashLog(source), 0
    forms = {form.type: form for forms in log._formats.values() for form in forms}
    places = sorted((start, kind) for kind in forms for start in log._offsets[kind].tolist())
    for start, type_ in places:
        form, record = forms[type_], raw[start : start + forms[type_].length]
        if form.time_field:
            (stamp,) = struct.unpack_from("<Q", record, form.fields["TimeUS"].offset)
        yield stamp, record, form


def hovering(source: Path, since_s: float, times: int) -> bytes:
    """A .BIN in which one second is flown so many times more: a hover that nobody asked for."""
    everything = list(records(source))
    begin = _first_stamp(source) + int(since_s * 1e6)
    second = [(record, form) for stamp, record, form in everything if begin <= stamp < begin + 1_000_000]
    return b"".join((
        *(record for stamp, record, _ in everything if stamp < begin),
        *(_later(record, form, n) for n in range(times + 1) for record, form in second),
        *(_later(record, form, times) for stamp, record, form in everything if stamp >= begin + 1_000_000),
    ))  # fmt: skip


def _later(record: bytes, form: Any, seconds: int) -> bytes:
    """A record with its stamps moved, the satellites' too."""
    moved = bytearray(record)
    for name, code, step in (("TimeUS", "<Q", 1_000_000), ("GMS", "<I", 1000)):
        if form.time_field and name in form.fields:
            at = form.fields[name].offset
            struct.pack_into(code, moved, at, struct.unpack_from(code, moved, at)[0] + seconds * step)
    return bytes(moved)


def _first_stamp(source: Path) -> int:
    return min(stamp for stamp, _, form in records(source) if form.time_field)


def test_a_parameter_that_the_log_lost_loosens_no_limit(tmp_path: Path) -> None:
    lost = tmp_path / "lost.BIN"
    lost.write_bytes(with_parameters(SLOW, lambda name: name == "LAND_SPEED"))
    assert results(SLOW)["mission_time"].status == results(lost)["mission_time"].status == "fault"
    assert limits(lost) == pytest.approx(limits(SLOW), rel=0.01)


def test_without_any_parameter_a_slow_flight_is_none_that_is_well(tmp_path: Path) -> None:
    lost = tmp_path / "lost.BIN"
    lost.write_bytes(with_parameters(SLOW, lambda name: not name.startswith(("SERVO", "FRAME", "MOT_PWM"))))
    assert results(lost)["mission_time"].status == "fault"


@pytest.mark.parametrize("before_the_end_s", [4.0, 8.0])
def test_two_minutes_that_nobody_asked_for_are_no_need_of_the_mission(tmp_path: Path, before_the_end_s: float) -> None:
    slow = tmp_path / "slow.BIN"
    slow.write_bytes(hovering(GOOD, judged(GOOD).run.mission.end_s - before_the_end_s, 120))
    assert limits(slow) == pytest.approx(limits(GOOD), rel=0.1)
    assert (results(GOOD)["mission_time"].status, results(slow)["mission_time"].status) == ("ok", "fault")


@pytest.mark.parametrize("factor", [1.8, 2.0, 3.0])
def test_a_battery_that_gives_twice_the_power_is_not_the_vehicles_own(tmp_path: Path, factor: float) -> None:
    thirsty = tmp_path / "thirsty.BIN"
    thirsty.write_bytes(restamped.dataflash_times(GOOD, "BAT", factor, "Curr", "CurrTot", "EnrgTot"))
    energy = results(thirsty)["energy"]
    assert energy.status == "not_evaluated"
    assert "vehicles of the training took" in energy.reason or "no vehicle of the training" in energy.reason
    assert "--threshold energy=VALUE" in energy.reason


def test_a_rover_that_takes_twice_the_energy_a_metre_is_not_judged_by_itself(tmp_path: Path) -> None:
    thirsty = tmp_path / "thirsty.BIN"
    thirsty.write_bytes(restamped.dataflash_times(ROVER, "BAT", 2.0, "Curr", "CurrTot", "EnrgTot"))
    assert results(ROVER, "ardurover")["energy"].status == "ok"
    assert results(thirsty, "ardurover")["energy"].status == "not_evaluated"


def leaning(source: Path, degrees: float) -> bytes:
    """A .BIN whose attitude is off by so much to the right, as that of a board that was levelled on a slope."""
    parts = []
    for _, record, form in records(source):
        moved = bytearray(record)
        for name in ("Roll", "DesRoll") if form.name == "ATT" else ():
            at = form.fields[name].offset
            struct.pack_into("<h", moved, at, struct.unpack_from("<h", moved, at)[0] + int(degrees * 100))
        parts.append(bytes(moved))
    return b"".join(parts)


def test_an_attitude_that_is_off_excuses_no_slow_flight_as_one_in_a_gale(tmp_path: Path) -> None:
    tilted = tmp_path / "tilted.BIN"
    tilted.write_bytes(leaning(SLOW, 20.0))
    time = results(tilted)["mission_time"]
    assert time.status == "not_evaluated"
    assert "wind_lean 22.9 deg, at most 13.1 in 19 of 20 training runs" in time.reason


def test_a_flight_that_needs_no_excuse_is_judged_whatever_its_attitude_says(tmp_path: Path) -> None:
    tilted = tmp_path / "tilted.BIN"
    tilted.write_bytes(leaning(GOOD, 20.0))
    assert results(tilted)["mission_time"].status == "ok"


def changed(source: Path, name: str, *steps: tuple[float, float]) -> bytes:
    """A .BIN with more records of a parameter: (seconds of the log, value)."""
    first, parts, left = _first_stamp(source), [], sorted(steps)
    template = next(
        (record, form)
        for _, record, form in records(source)
        if form.name == "PARM" and name.encode() in record[form.fields["Name"].offset :][:16]
    )
    for stamp, record, _ in records(source):
        while left and stamp >= first + left[0][0] * 1e6:
            parts.append(_set(*template, first + int(left[0][0] * 1e6), left.pop(0)[1]))
        parts.append(record)
    return b"".join(parts)


def _set(template: bytes, form: Any, stamp: int, value: float) -> bytes:
    record = bytearray(template)
    struct.pack_into("<Q", record, form.fields["TimeUS"].offset, stamp)
    struct.pack_into("<f", record, form.fields["Value"].offset, value)
    return bytes(record)


def test_a_value_that_was_put_back_before_the_end_is_the_one_that_is_judged(tmp_path: Path) -> None:
    run = judged(SLOW).run
    assert run.config["LAND_SPEED"] == pytest.approx(16, abs=5)
    sly = tmp_path / "sly.BIN"
    sly.write_bytes(changed(SLOW, "LAND_SPEED", (run.mission.end_s - 1.0, 50.0)))
    put_back = judged(sly)
    assert [one.value for one in put_back.run.changes["LAND_SPEED"]] == [run.config["LAND_SPEED"], 50.0]
    assert put_back.run.config["LAND_SPEED"] == run.config["LAND_SPEED"]
    assert {one.name: one.status for one in put_back.results} == {o.name: o.status for o in judged(SLOW).results}


def test_a_value_that_only_the_landing_had_is_the_one_that_is_judged(tmp_path: Path) -> None:
    run = judged(SLOW).run
    sly = tmp_path / "sly.BIN"
    sly.write_bytes(changed(SLOW, "LAND_SPEED", (run.mission.start_s + 40.0, 50.0), (run.mission.end_s - 65.0, 12.0)))
    assert judged(sly).run.config["LAND_SPEED"] == 12.0


def test_json_holds_the_need_that_the_limit_is_made_of(care: Callable[..., tuple[int, str, str]]) -> None:
    _, out, _ = care("triage", SLOW, "--json", "--profile", "arducopter")
    time = next(one for one in json.loads(out)["objectives"] if one["name"] == "mission_time")
    assert time["threshold"]["value"] == pytest.approx(1.3 * time["needs"]["value"], rel=1e-3)
