"""Heights above home in metres, whatever unit the firmware wrote."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from care_core.ecosystems.ardupilot.heights import in_metres
from care_core.logs.base import Table
from tests.tables import TablesLog

T = np.arange(0.0, 60.0)
HEIGHT_M = np.interp(T, [0, 20, 40, 60], [0, 30, 30, 0])


def peak(recorded: np.ndarray, others: dict[str, Table], declared: Sequence[tuple[str, str]] = ()) -> float:
    tables = {"POS": Table(T, {"RelHomeAlt": recorded}), **others}
    for types, factors in declared:
        tables["FMT"] = texts(Type=[20.0], Name=["POS"], Format=[types], Columns=["TimeUS,RelHomeAlt"])
        tables["FMTU"] = texts(FmtType=[20.0], UnitIds=["sm"], MultIds=[factors])
        tables["MULT"] = texts(Id=[float(ord("B")), float(ord("0")), float(ord("F"))], Mult=[0.01, 1.0, 1e-6])
    return float(in_metres(TablesLog(tables, 60.0)).read({"POS": ("RelHomeAlt",)})["POS"]["RelHomeAlt"].max())


def texts(**columns: Sequence[object]) -> Table:
    rows = len(next(iter(columns.values())))
    return Table(np.zeros(rows), {
        name: np.array(values, object if isinstance(values[0], str) else np.float64) for name, values in columns.items()
    })  # fmt: skip


@pytest.mark.parametrize(("message", "field"), [("BARO", "Alt"), ("CTUN", "BAlt"), ("GPS", "Alt"), ("CTUN", "Alt")])
def test_centimetres_are_told_by_any_other_height(message: str, field: str) -> None:
    other = {message: Table(T, {field: 400 + HEIGHT_M * 1.1})}
    assert peak(100 * HEIGHT_M, other) == pytest.approx(30.0)
    assert peak(HEIGHT_M, other) == 30.0


def test_a_high_flight_in_metres_stays_one() -> None:
    assert peak(20 * HEIGHT_M, {"BARO": Table(T, {"Alt": 19 * HEIGHT_M})}) == 600.0


def test_where_no_other_height_is_recorded_the_log_s_own_unit_counts() -> None:
    assert peak(100 * HEIGHT_M, {}, [("Qf", "FB")]) == pytest.approx(30.0)
    assert peak(100 * HEIGHT_M, {}, [("Qf", "F0")]) == 3000.0
    assert peak(100 * HEIGHT_M, {}, [("Qe", "FB")]) == 3000.0, "the reader has scaled it already"
    assert peak(100 * HEIGHT_M, {}) == 3000.0


def test_what_a_log_declares_of_its_unit_is_not_believed_against_its_other_heights() -> None:
    barometer = {"BARO": Table(T, {"Alt": 5 * HEIGHT_M})}
    assert peak(5 * HEIGHT_M, barometer, [("Qf", "FB")]) == 150.0
