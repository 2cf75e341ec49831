"""A light probe from a file."""

from __future__ import annotations

from pathlib import Path

from pipeline.data.light_probes import LightProbe
from pipeline.devices.probe_files import read_probe


def light_probe(*, file: Path, caption: str = "") -> LightProbe:
    """Read a light probe in latitude and longitude.

    Its middle is taken to lie straight behind the viewer, up is its upper edge; ``render.environment`` turns it.

    Parameters
    ----------
    file : Path
        An EXR or HDR file, or any other colour picture that OpenImageIO reads, twice as wide as high. Values are taken
        as linear sRGB; those of JPEG, WebP, GIF and HEIF are decoded.
    caption : str
        What it shows and where it comes from, for the report.

    Returns
    -------
    LightProbe
        As the file has it.

    Raises
    ------
    InputError
        The file is missing, unreadable, grey, of another shape, black, or holds what is no light.
    """
    return LightProbe(read_probe(file), caption or "Light probe")


def _check_light_probe(*, file: Path, caption: str) -> None:
    """Decode the file before anything runs."""
    light_probe(file=file, caption=caption)
