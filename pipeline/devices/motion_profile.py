"""Motion at limited speed and acceleration: the trapezoidal profile of CiA 402's profile position mode."""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, sqrt


@dataclass(frozen=True)
class Stretch:
    """A time of uniform acceleration.

    Attributes
    ----------
    seconds : float
        How long it lasts.
    acceleration : float
        Signed, in units a second squared.
    """

    seconds: float
    acceleration: float


@dataclass(frozen=True)
class Motion:
    """An axis under way: uniformly accelerated stretches, then rest.

    Attributes
    ----------
    start, velocity : float
        Position and signed speed at the beginning.
    stretches : tuple of Stretch
        What follows; the speed is zero after the last.
    """

    start: float
    velocity: float = 0.0
    stretches: tuple[Stretch, ...] = ()

    @property
    def seconds(self) -> float:
        """Time until rest."""
        return sum(stretch.seconds for stretch in self.stretches)

    def at(self, seconds: float) -> tuple[float, float]:
        """Position and speed ``seconds`` after the beginning."""
        position, velocity = self.start, self.velocity
        for stretch in self.stretches:
            lasted = min(max(seconds, 0.0), stretch.seconds)
            position += (velocity + stretch.acceleration * lasted / 2) * lasted
            velocity += stretch.acceleration * lasted
            if seconds < stretch.seconds:
                return position, velocity
            seconds -= stretch.seconds
        return position, 0.0


def braking(start: float, velocity: float, deceleration: float) -> Motion:
    """Come to rest as fast as ``deceleration`` allows."""
    if velocity == 0:
        return Motion(start)
    return Motion(start, velocity, (Stretch(abs(velocity) / deceleration, -copysign(deceleration, velocity)),))


def trapezoid(
    start: float,
    target: float,
    *,
    velocity: float,
    acceleration: float,
    deceleration: float,
    velocity_now: float = 0.0,
) -> Motion:
    """Go from ``start`` to rest at ``target`` in the least time that the limits allow.

    Parameters
    ----------
    start, target : float
        Positions.
    velocity, acceleration, deceleration : float
        Limits, positive.
    velocity_now : float
        Signed speed at the beginning. An axis that moves away from the target, too fast, or too near to brake before
        it, comes to rest first.

    Returns
    -------
    Motion
        Ends at ``target``.
    """
    way = target - start
    speed = abs(velocity_now)
    away = velocity_now * way < 0
    if away or speed > velocity or speed**2 / (2 * deceleration) > abs(way):
        stop = braking(start, velocity_now, deceleration)
        rest = stop.at(stop.seconds)[0]
        then = trapezoid(rest, target, velocity=velocity, acceleration=acceleration, deceleration=deceleration)
        return Motion(start, velocity_now, stop.stretches + then.stretches)
    if way == 0:
        return Motion(start)
    energy = 2 * acceleration * deceleration * abs(way) + deceleration * speed**2
    peak = min(velocity, sqrt(energy / (acceleration + deceleration)))
    ramps = (peak**2 - speed**2) / (2 * acceleration) + peak**2 / (2 * deceleration)
    cruise = max(abs(way) - ramps, 0.0) / peak
    return Motion(
        start,
        velocity_now,
        (
            Stretch((peak - speed) / acceleration, copysign(acceleration, way)),
            Stretch(cruise, 0.0),
            Stretch(peak / deceleration, -copysign(deceleration, way)),
        ),
    )
