"""A height map that others measured and published."""

from __future__ import annotations

from typing import Literal

from pipeline.data.height_fields import HeightField
from pipeline.devices.height_files import MapDescription, read_height_file
from pipeline.devices.published_maps import PUBLISHED, published_file
from pipeline.limits import above_zero, refuse


def published_height_map(
    *,
    name: Literal["elaphe", "xenopeltis", "elaphe_crop", "xenopeltis_crop", "blaze_tile", "cosine_tile"],
    full_height_um: float | None = None,
) -> HeightField:
    """Take a published map by its name.

    A copy is looked for in the folder that the environment variable ``OPTIBENCH_DATA`` names and in the user's cache;
    otherwise it is downloaded once from where it is published. Its digest is checked every time.

    Parameters
    ----------
    name : str
        ``elaphe`` and ``xenopeltis``: sheds of snakes under an atomic-force microscope, 65 um wide; ``elaphe_crop`` and
        ``xenopeltis_crop``: patches of 6.5 um; ``blaze_tile`` and ``cosine_tile``: one period, drawn.
    full_height_um : float, optional
        Height of the lightest grey over the darkest, instead of the published one (that of ``elaphe`` is uncertain).

    Returns
    -------
    HeightField
        float32; the caption names the source and its licence.

    Raises
    ------
    InputError
        The map is neither on this machine nor to be downloaded.

    References
    ----------
    Single, Diffraction Shader, bachelor thesis, University of Bern (2014), chapter 3.
    """
    published = PUBLISHED[name]
    refuse(above_zero(full_height_um=full_height_um))
    full = published.full_height_um if full_height_um is None else full_height_um
    told = MapDescription(published.pitch_um, full, periodic=published.periodic, caption=published.caption)
    return read_height_file(published_file(published), told)


def _check_published_height_map(
    *,
    name: Literal["elaphe", "xenopeltis", "elaphe_crop", "xenopeltis_crop", "blaze_tile", "cosine_tile"],
    full_height_um: float | None,
) -> None:
    """Get the file before anything runs."""
    refuse(above_zero(full_height_um=full_height_um))
    published_file(PUBLISHED[name])
