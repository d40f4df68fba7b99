"""Which robot a log is of: what it says of its board, its owner's numbers, its recorder's notes; else nobody's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from care_core.extract.identity import robot_of
from care_core.run import Setting
from tests.made import MadeLog, T

BOARD = "CubeOrange 003E0031 3532510E 38303638"


@dataclass
class _Log(MadeLog):
    numbers: Mapping[str, float] = field(default_factory=dict)

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return {name: (Setting(name, value, "PARM"),) for name, value in self.numbers.items()}


def saying(*texts: str, facts: Mapping[str, str] | None = None, **numbers: float) -> _Log:
    messages: dict[str, Any] = {"Message": np.array([*texts, *["mode"] * (len(T) - len(texts))], dtype=object)}
    return _Log({"MSG": messages}, facts=facts or {}, numbers=numbers)


@pytest.mark.parametrize(
    ("log", "robot"),
    [
        (saying("ArduCopter V4.5.4 (fd1bcc61)", BOARD, BRD_SERIAL_NUM=7), BOARD),
        (saying("Dd1219c7c4c5404aaa1f6d2a48adfda4"), "Dd1219c7c4c5404aaa1f6d2a48adfda4"),
        (saying("New mission", BRD_SERIAL_NUM=7, SYSID_THISMAV=4), "serial 7"),
        (saying(BRD_SERIAL_NUM=0, SYSID_THISMAV=4), "system 4"),
        (saying(MAV_SYSID=12), "system 12"),
        (saying(facts={"system": "3.1"}), "system 3"),
        (saying(facts={"Hostname": "husky-2 "}), "husky-2"),
        (saying(SYSID_THISMAV=1, BRD_SERIAL_NUM=-1, facts={"system": "1.1", "robot": " "}), None),
    ],
)
def test_the_best_name_a_log_gives(log: MadeLog, robot: str | None) -> None:
    assert robot_of(log) == robot


def test_a_name_cannot_steer_a_terminal() -> None:
    assert robot_of(saying(facts={"robot": "\x1b[31mred"})) == "\\x1b[31mred"
