"""Which finding can bring about which: the one table of physical steps, for every ecosystem.

A row holds direct steps alone. What a cause leads to by several steps it does through findings that are there: a motor
upsets the estimator through an attitude that was lost, not past one that was held.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from care_core.ecosystems.findings import FindingKind

Explains = Mapping[FindingKind, frozenset[FindingKind]]
"""Per kind of finding the kinds that it can bring about directly."""

_TUMBLES: frozenset[FindingKind] = frozenset(
    ("crash", "takeoff", "thrust", "estimator", "vibration", "imu", "gps", "compass", "barometer", "log")
)
"""What turns over falls with its motors at their limit; its antenna looks down, its sensors turn faster than they or
the estimator can follow, and air streams over the barometer."""

EXPLAINS: Explains = {
    # --- vehicles: what fails first shows in what follows, the attitude and the crash last
    "vibration": frozenset(  # aliased and clipped inertial data; at rest, of accelerometers that are noisy
        ("imu", "estimator", "tuning", "attitude", "crash", "prearm")
    ),
    "imu": frozenset(  # a false tilt turns the magnetic field, and keeps the vehicle from arming
        ("vibration", "estimator", "tuning", "thrust", "attitude", "crash", "compass", "prearm", "localisation")
    ),
    "motor": frozenset(("thrust", "tuning", "vibration", "attitude", "takeoff", "crash")),
    "thrust": frozenset(("attitude", "battery", "takeoff", "crash")),  # full throttle draws the pack down
    "gps": frozenset(("estimator", "attitude", "crash", "prearm")),  # position control leans after a false position
    "compass": frozenset(("estimator", "attitude", "crash", "prearm")),  # a false heading steers the wrong way
    "barometer": frozenset(("estimator", "thrust", "crash", "prearm")),  # a false height
    "leak": frozenset(("battery", "imu", "compass", "barometer", "motor", "log", "prearm")),  # it shorts things
    "airspeed": frozenset(("estimator", "attitude", "thrust", "crash", "prearm")),  # it flies too slow, or too fast
    "surface": frozenset(("tuning", "vibration", "thrust", "attitude", "takeoff", "airspeed", "motor", *_TUMBLES)),
    "estimator": frozenset(("attitude", "crash", "prearm")),
    "tuning": frozenset(("vibration", "thrust", "estimator", "attitude", "takeoff", "crash")),
    "takeoff": frozenset(("attitude", "motor", "compass", "tuning", *_TUMBLES)),  # motors run on against the ground
    "attitude": frozenset(_TUMBLES),
    # --- robots that drive by their sensors
    "laser": frozenset(("laser", "localisation", "planner", "blocked", "control", "tf", "software")),
    "localisation": frozenset(("localisation", "planner", "blocked", "control", "tf")),
    "drive": frozenset(("drive", "planner", "control", "prearm")),
    "commands": frozenset(("drive", "planner", "control", "thrust", "attitude", "crash", "log")),
    "tf": frozenset(("tf", "planner", "control")),
    "topics": frozenset(("tf", "planner", "control")),  # no topic ends another: a node ends several
    "planner": frozenset(("planner", "control", "tf")),  # one that finds no path keeps the computer busy
    "control": frozenset(("control",)),
    "clearance": frozenset(("blocked", "drive", "planner", "control", "crash")),  # it drives into things
    "software": frozenset(("software", "topics")),
    # --- both
    "battery": frozenset(
        ("battery", "thrust", "log", "crash", "prearm", "drive", "commands", "topics", "laser", "cpu")
    ),
    "cpu": frozenset(("cpu", "estimator", "tuning", "log", "attitude", "crash", "control", "tf", "topics", "commands")),
    "radio": frozenset(("crash", "topics", "laser", "localisation", "commands", "drive", "tf", "imu")),
    "blocked": frozenset(
        ("motor", "thrust", "tuning", "vibration", "attitude", "crash", "planner", "drive", "control", "tf")
    ),
    "crash": frozenset(
        ("attitude", "log", "vibration", "imu", "estimator", "gps", "compass", "barometer", "localisation", "drive",
         "planner", "control", "software")
    ),
}  # fmt: skip
"""By physics, not by statistics. A compass loses no fix, and a battery makes no gyro noisy."""

OF_ROVERS: Explains = {**EXPLAINS, "drive": EXPLAINS["drive"] | {"estimator", "compass"}}
"""What moves while it is disarmed aligns no estimator, and none of its sensors agree."""

_ESTIMATED = "ekf|ahrs|dcm|position|home|velocity|variance"
_WORDS: Mapping[FindingKind, str] = {
    "gps": f"gps|fix|hdop|satell|fence|{_ESTIMATED}",
    "compass": f"compass|mag|heading|yaw|{_ESTIMATED}",
    "barometer": f"baro|alt|height|vertical|{_ESTIMATED}",
    "imu": f"imu|ins|gyro|accel|attitude|roll|{_ESTIMATED}",
    "vibration": f"accel|vibration|attitude|{_ESTIMATED}",
    "airspeed": "airspeed|pitot",
    "battery": "batt|volt|power",
    "drive": f"gps|compass|gyro|accel|mag|yaw|{_ESTIMATED}",
    "estimator": f"gps|compass|yaw|attitude|estimat|{_ESTIMATED}",
}
REFUSES = {kind: re.compile(rf"\b({words})", re.IGNORECASE) for kind, words in _WORDS.items()}
"""What a refusal to arm speaks of where a part keeps the vehicle from arming: any other has a reason of its own."""
