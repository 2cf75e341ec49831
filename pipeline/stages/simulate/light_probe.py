"""A light probe that needs no file."""

from __future__ import annotations

from typing import Literal

from pipeline.data.light_probes import LightProbe
from pipeline.limits import refuse, within
from pipeline.optics.environment.procedural import SCENES, drawn

_CAPTIONS = {
    "room": "A room with a window of four panes and three lamps",
    "outdoors": "A clear sky with the sun, over grass",
    "uniform": "White from everywhere",
}


def light_probe(
    *, scene: Literal["room", "outdoors", "uniform"] = "room", rows: int = 256, lamp_deg: float = 4.0
) -> LightProbe:
    """Draw a light probe.

    Parameters
    ----------
    scene : {"room", "outdoors", "uniform"}
        A room with a window behind the viewer's left shoulder and three warm lamps to the right of it; a sky with a sun
        behind the right shoulder, over grass; or white everywhere.
    rows : int
        Height of the picture, half its width.
    lamp_deg : float
        Angle across each lamp, or the sun; the light that it gives stays the same.

    Returns
    -------
    LightProbe
        Radiance, white paper in the uniform one being 1.

    Raises
    ------
    InputError
        A size that a picture or a lamp cannot have.
    """
    _check_light_probe(rows=rows, lamp_deg=lamp_deg)
    return LightProbe(drawn(SCENES[scene](lamp_deg), rows), _CAPTIONS[scene])


def _check_light_probe(*, rows: int, lamp_deg: float, **_: object) -> None:
    """Refuse impossible sizes before anything runs."""
    refuse(within(8, 4096, rows=rows), within(0.05, 90, lamp_deg=lamp_deg))
