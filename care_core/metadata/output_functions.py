"""What drives what: the numbers of ArduPilot's SERVOn_FUNCTION (SRV_Channel.h)."""

from __future__ import annotations

from collections.abc import Mapping

MOTORS: Mapping[int, int] = {**{n: 32 + n for n in range(1, 9)}, **{n: 73 + n for n in range(9, 13)}}
"""Number of a motor -> its function: k_motor1 to k_motor8 are 33 to 40, k_motor9 to k_motor12 are 82 to 85."""
MOTORS_OF_FRAME: Mapping[int, int] = {1: 4, 2: 6, 3: 8, 4: 8, 5: 6, 12: 12, 14: 10}
"""FRAME_CLASS -> its motors (AP_MotorsMatrix.cpp)."""
OUTPUTS = range(1, 17)
"""Outputs whose function can be set."""
AILERONS, ELEVATOR, RUDDER = 4, 19, 21
STEERING, THROTTLE, LEFT, RIGHT = 26, 70, 73, 74
"""LEFT and RIGHT are the throttles of a vehicle that steers by driving its sides apart."""
TILTS = (75, 76)
"""What tilts the motors on the left and on the right."""
