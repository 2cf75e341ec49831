"""Panels that are not as even in time as one would like."""

from __future__ import annotations

from pipeline.devices.simulated import Panel


class WarmingPanel(Panel):
    """A panel that grows brighter while it warms up.

    Parameters
    ----------
    radiance : float
        When warm, relative to the panel for which the camera's exposure is stated.
    cold_percent : float
        How much darker the first photograph is than the warm panel would make it.
    photos_to_warm : float
        Photographs after which the difference has fallen to 1/e.
    """

    def __init__(self, *, radiance: float = 1.0, cold_percent: float = 5.0, photos_to_warm: float = 3.0) -> None:
        super().__init__(radiance=radiance)
        self.cold_percent = cold_percent
        self.photos_to_warm = photos_to_warm
        self._looks = 0

    @property
    def present_radiance(self) -> float:
        """Radiance now; each look is one photograph."""
        from math import exp

        cold = self.cold_percent / 100 * exp(-self._looks / self.photos_to_warm)
        self._looks += 1
        return super().present_radiance * (1 - cold)
