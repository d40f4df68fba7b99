"""What to do about each finding, in a sentence: the one place of the texts. What a title says exactly comes before
its kind.

A row is true of every vehicle that can have its finding: where robots on wheels need another advice, theirs stands in a
table of its own.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from care_core.ecosystems.findings import (
    ASKED_SPEED,
    CAME_DOWN,
    LEANED,
    LOST_SIGHT,
    NO_MISSION,
    NO_POSITION_FOR,
    NOT_BEGUN,
    OF_MONITOR,
    OWN_SUPPLY,
    UNPOWERED,
    Finding,
    FindingKind,
)

CHARGE = "charge or replace the battery"
LAND_EARLIER = "land earlier, or fly with a fuller, larger or newer battery"
CLEAR_REFUSAL = "clear what refused arming: {why}"
ASK_WHO_CUT = "ask why the motors were cut, and check what the fall broke"
LOOK_AT_STEERING = "look at how it was steered: its throttle stick was down"
LOOK_AT_ITS_WAY = "look for what stands in its way there, and send it higher or around it"
TUNE = "look at the gains and filters of what swings ({title})"
"""Remedies that the next step chooses by more than the title and kind of one finding."""

_LIFT = "check the propellers, motors and the battery under load, and weigh it: it should hover at about half throttle"
_ANTENNA = "look at the GPS antenna: its view of the sky, walls that reflect, and what transmits close to it"
_HIT = "look at what it ran into and why its sensors did not see it: too low, glass, outside their view"
_TAKES_TIME = "find the node that takes the computer's time ('top' on the robot while it drives)"

_BY_TITLE: tuple[tuple[str, str], ...] = (
    # --- vehicles
    (r"(motors? .*) (gave too little|lost) thrust", r"check \1: its propeller, ESC, solder joints and bearings"),
    (
        "all motors were told to stop",
        "find out what stopped the motors: the land detector, a switch or a failsafe, as the messages around it say",
    ),
    (
        "the motors lost their power",
        "check the battery's plug, the power module and the wiring to the motor controllers, under load and shaken",
    ),
    ("the motor lost thrust", "check the motor, its propeller and its ESC, and the battery under load"),
    (rf"too little thrust|hovering takes|{re.escape(CAME_DOWN)}", _LIFT),
    (re.escape(UNPOWERED), "check that the ESCs have power and that the propellers are fitted"),
    (
        "the throttle swings",
        "look at the gains of the height control (PSC_ACCZ, PSC_VELZ) and at what tells it its height, in a low hover",
    ),
    (
        "strong vibration",
        "balance or change the propellers, and look for loose mounts and for cables that touch the autopilot",
    ),
    (
        "an accelerometer exceeds its range",
        "mount the autopilot on softer foam, and look for what strikes or shakes the frame",
    ),
    (
        "the gyro is offset",
        "let it stand still while it starts, so that it calibrates its gyros; replace it if they still turn at rest",
    ),
    ("the accelerometers feel gravity upside down", "see that AHRS_ORIENTATION says how the board is mounted"),
    ("the accelerometers do not feel gravity", "calibrate the accelerometers, and replace the autopilot if that fails"),
    (
        "it never went over to its wings|full throttle does not bring",
        "check the engine that drives it forward: motor, controller and propeller; and what THR_MAX lets it give",
    ),
    (
        r"only \d+ satellites|poor satellite geometry",
        "wait under open sky for more satellites before arming, and look at the GPS antenna if they do not come",
    ),
    (
        "the GPS fix was lost|the satellite receiver loses",
        "check the GPS receiver's cable and supply, its view of the sky, and what transmits close to it",
    ),
    (
        "the compass reads nothing",
        "check the compass's cable, and COMPASS_ parameters for values that are not numbers",
    ),
    (
        "the estimated attitude is wrong",
        "see that AHRS_ORIENTATION says how the board is mounted, and let it stand still while it starts, so that it "
        "calibrates its gyros",
    ),
    (
        "the estimator rejects its measurements",
        "find which measurement it rejects: look at GPS, compass, barometer and vibration at that time",
    ),
    (
        r"the estimated (height|climb rate) runs away",
        "see what barometer and accelerometers read while it stands, and calibrate these: one of the two is off",
    ),
    (LEANED, "start level: no roll or pitch, by stick or by a program, before it is in the air"),
    (
        "it tipped over at take-off",
        "see that it stands level and free, and check the motors' order and directions, propellers and landing gear",
    ),
    ("barometer and range finder", "lift it to a height that you measure, and see which of the two is wrong"),
    (r"(.*) (?:is|are) at the stop", r"check \1: servo, linkage and horn, free travel, and the load in flight"),
    (
        r"(.*) turns? the plane the wrong way",
        r"tilt the plane in FBWA and watch \1: where it answers the right way, look for a servo that stuck in flight",
    ),
    (r"(.*) no longer obeys?", r"look at \1: a servo that stuck, its gears and supply, linkage, horn and hinges"),
    ("the plane stalled", "look at what made it so slow: its lowest airspeed, its weight, its thrust"),
    (r"\w+ turns against its motors", "check the motors' order and directions with the motor test, and the propellers"),
    (ASKED_SPEED, "look at the program that commands it: what it sends, in which unit, and what bounds it"),
    (
        LOST_SIGHT,
        "look for it where it was last (the map shows where); its own log, on its memory card, tells whether its link "
        "or its power was lost",
    ),
    (
        rf"power was lost|the log ends in the air|{re.escape(OWN_SUPPLY)}",
        "check the battery's connector, the power module and the autopilot's 5 V supply under load",
    ),
    (f"{NO_MISSION}|{NOT_BEGUN}", "upload the mission again, or start it anew, and see that the vehicle takes it"),
    (
        f"(.*){NO_POSITION_FOR}",
        r"give it a source of position (GPS, optical flow, a camera), and wait for it before \1; Altitude needs none",
    ),
    ("|".join(OF_MONITOR), "check the power module's cable and BATT_MONITOR"),
    # --- robots
    ("the laser falls silent|the laser drops out", "check the laser's cable and supply, and its driver's log"),
    (
        "the laser is stuck",
        "restart the laser's driver before it drives: on a stuck scan it sees no obstacle",
    ),
    ("the laser is noisy|the laser sees nothing", "clean the laser's window, and look for sunlight and what covers it"),
    (
        "odometry drifts",
        "check wheel radius, wheel separation and encoders: drive 5 m straight and turn once, and compare",
    ),
    (
        r"odometry (jumps|tells impossible|has no|never moved)",
        "check the encoders, and the driver or filter that publishes odometry",
    ),
    ("localisation jumps", "set its initial pose, and check map, odometry and where the laser is mounted (tf)"),
    (r"two sources publish (.*) in turn", r"stop one of the two nodes that publish \1"),
    (
        "the drive does not answer|the robot does not move",
        "check the emergency stop, the motor driver's fault light and fuse, and that commands reach the driver",
    ),
    (
        "the drive is weak",
        "check the battery under load, the motor driver's current limit, gears, wheels and load",
    ),
    ("the drive pulls to", "compare both wheels: diameter, friction, gear and encoder"),
    (
        "commands reach the drive only",
        "check what lies between planner and drive: Wi-Fi, a multiplexer of commands, and the driver's time-out",
    ),
    ("something appeared", "clear its way or send it around: nothing shows that the robot failed"),
    ("something holds", "free it, and look at what it is caught on"),
    ("the robot (hits|touches|stays against)", _HIT),
    (r"the robot (tips|falls)", "look at the ground where it went over, at its load and at how fast it turned"),
    ("the computer is too busy", f"{_TAKES_TIME}, and lower its rate"),
    (r"(\S+): .*\b[Mm]ission (has )?failed", r"look at what \1 said before that"),
    (r"diagnostics: (.*)", r"look at what its driver reports: \1"),
)
"""Patterns of titles, from their first character on, with what to do; the first that fits counts."""

_BY_KIND: Mapping[FindingKind, str] = {
    "motor": "check the motors, their propellers, ESCs and wiring",
    "thrust": _LIFT,
    "gps": _ANTENNA,
    "compass": "move the compass away from power leads and iron, and calibrate it again",
    "barometer": "cover the barometer with foam, and keep the propellers' air and sunlight from it",
    "imu": "check how the autopilot is mounted, calibrate again, and replace it if its sensors still disagree",
    "battery": CHARGE,
    "radio": "check the link's antennas and range, and what its failsafe is set to do",
    "airspeed": "check the pitot tube for blockage and its hoses for leaks, and calibrate it before take-off",
    "leak": "dry the hull, and find the leak with a vacuum test before the next dive",
    "cpu": "turn off what loads the autopilot (logging, scripts, filters), and look at its SD card",
    "blocked": "look at what it was caught on or pushed against, and clear it",
    "laser": "check the laser's cable, supply and driver",
    "localisation": "check what localises it: odometry, map, laser and the transforms between them",
    "drive": "check the drive, wheels and wiring, and the motor driver's faults",
    "commands": "look at what sends the drive's commands, and at its rate",
}

_OF_ROBOTS: Mapping[FindingKind, str] = {
    "imu": "check the IMU's cable, mount and driver",
    "radio": "check the robot's Wi-Fi along its way, and record on the robot itself",
    "cpu": _TAKES_TIME,
    "blocked": _HIT,
}


def remedy(finding: Finding, *, is_robot: bool) -> str:
    """What to do about a finding; empty where its title and kind do not tell."""
    for pattern, text in _BY_TITLE:
        if match := re.match(pattern, finding.title):
            return match.expand(text)
    of_robot = _OF_ROBOTS.get(finding.kind, "") if is_robot else ""
    return of_robot or _BY_KIND.get(finding.kind, "")
