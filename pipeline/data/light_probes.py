"""Light probes."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.data.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class LightProbe:
    """All that is seen from one place, in latitude and longitude.

    Attributes
    ----------
    rgb : ndarray of shape (M, 2 M, 3), float32
        Radiance, linear sRGB in any unit. Row 0 is straight up; the middle is straight behind the viewer of a sheet,
        and columns run to the right as seen from the sheet.
    caption : str
        What is seen.
    """

    rgb: FloatArray
    caption: str = ""
