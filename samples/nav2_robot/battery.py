"""A battery that is drawn on by driving: charge in J, volts under load."""

from __future__ import annotations

from dataclasses import dataclass

CAPACITY_J = 25.0 * 3600.0
"""25 Wh: a small pack, so that a mission is seen in its charge."""
FULL_V, EMPTY_V, OHMS = 26.0, 21.5, 0.08
CUT_OUT_V = 20.5
"""Below this the motor controllers switch off."""

_IDLE_W, _W_PER_MPS, _W_PER_RADPS, _W_PER_MPS2 = 22.0, 55.0, 30.0, 12.0


@dataclass
class Battery:
    """The state of the pack."""

    charge: float
    """Share that is left."""
    power_w: float = _IDLE_W
    drawn_j: float = 0.0
    lost_v: float = 0.0
    """What a failing cell takes away."""

    @property
    def amps(self) -> float:
        return self.power_w / max(self._at_rest, 1.0)

    @property
    def volts(self) -> float:
        return self._at_rest - OHMS * self.amps

    @property
    def is_out(self) -> bool:
        return self.volts < CUT_OUT_V

    @property
    def _at_rest(self) -> float:
        return EMPTY_V + (FULL_V - EMPTY_V) * max(self.charge, 0.0) - self.lost_v

    def draw(self, speed: float, turn: float, acceleration: float, dt: float) -> None:
        """Power of one step: m/s, rad/s and m/s^2 of the wheels, for s."""
        speeding_up = max(acceleration, 0.0) * _W_PER_MPS2
        self.power_w = _IDLE_W + _W_PER_MPS * abs(speed) + _W_PER_RADPS * abs(turn) + speeding_up
        self.drawn_j += self.power_w * dt
        self.charge -= self.power_w * dt / CAPACITY_J
