"""Motion of an axis that may not jump in speed: the trapezoidal profile of CiA 402's position mode."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt


@dataclass(frozen=True)
class TrapezoidalMove:
    """A move from standstill to standstill.

    Attributes
    ----------
    start, target : float
        Positions, in counts.
    velocity : float
        Highest speed, in counts a second.
    acceleration : float
        Of speeding up and of braking, in counts a second squared.
    began_s : float
        When it began.
    """

    start: float
    target: float
    velocity: float
    acceleration: float
    began_s: float

    @property
    def _peak(self) -> float:
        """Highest speed reached: short moves brake before they are at full speed."""
        return min(self.velocity, sqrt(abs(self.target - self.start) * self.acceleration))

    @property
    def duration_s(self) -> float:
        """Seconds from standstill to standstill."""
        distance = abs(self.target - self.start)
        return 0.0 if distance == 0 else distance / self._peak + self._peak / self.acceleration

    def position(self, now_s: float) -> float:
        """Where the axis is, in counts."""
        elapsed, total = now_s - self.began_s, self.duration_s
        if elapsed >= total:
            return self.target
        if elapsed <= 0:
            return self.start
        ramp = self._peak / self.acceleration
        if elapsed < ramp:
            travelled = self.acceleration * elapsed**2 / 2
        elif elapsed <= total - ramp:
            travelled = self._peak * (elapsed - ramp / 2)
        else:
            travelled = abs(self.target - self.start) - self.acceleration * (total - elapsed) ** 2 / 2
        return self.start + (travelled if self.target > self.start else -travelled)

    def finished(self, now_s: float) -> bool:
        """Whether the axis has arrived."""
        return now_s - self.began_s >= self.duration_s

    def braked(self, now_s: float, deceleration: float) -> TrapezoidalMove:
        """The move that brings the axis to rest from where and how fast it is now."""
        here, soon = self.position(now_s), self.position(now_s + 1e-6)
        speed = (soon - here) / 1e-6
        rest = here + speed * abs(speed) / (2 * deceleration)
        return TrapezoidalMove(here, rest, max(abs(speed), 1.0), deceleration, now_s)
