"""The files that a tutorial begins with: parameters, profile and campaign, for ROS 1 as they lie here, or for ROS 2."""

from __future__ import annotations

import re
from pathlib import Path

from care_samples.parameters import write_start

_HERE = Path(__file__).parent / "start"
_NAMES = ("courier.yaml", "profile.yaml", "campaign.yaml")

_ROS2 = {
    "courier.yaml": ((r"^courier:\n", "courier:\n ros__parameters:\n"),),
    "profile.yaml": (
        (r"logs: \[ros1-bag\]", "logs: [mcap]"),
        (r"kind: actionlib_goals\n  action: /courier", "kind: nav2_goals"),
        (r"parameter: /courier/(\w+)/(\w+)", r"parameter: /courier.\1.\2"),
    ),
    "campaign.yaml": ((r"drive\.bag", "drive.mcap"),),
}
"""What ROS 2 has otherwise: texts, and what they become."""


def write_robot(folder: Path, ros: int) -> None:
    """Write the files; those that are there already stay."""
    texts = {}
    for name in _NAMES:
        texts[name] = (_HERE / name).read_text(encoding="utf-8")
        for pattern, other in _ROS2[name] if ros == 2 else ():
            texts[name] = re.sub(pattern, other, texts[name], flags=re.MULTILINE)
    write_start(texts, folder)
