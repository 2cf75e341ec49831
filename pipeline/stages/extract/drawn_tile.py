"""The tile that was drawn, as a tile that was found on its sheet shows it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.data.flash import FlashPhotographs, Tiles
from pipeline.data.gratings import GratingSample
from pipeline.errors import InputError
from pipeline.optics.sheet.view import rectified


def drawn_tile(sample: GratingSample, tiles: Tiles, photos: FlashPhotographs) -> GratingSample:
    """Sample the drawing where the pixels of the reference tile lie, to compare maps of that tile with it.

    A tile that was found begins anywhere in the pattern; the sheet begins with a whole tile in its top left corner.

    Parameters
    ----------
    sample : GratingSample
        The tile as it was drawn.
    tiles : Tiles
        Of which the reference counts.
    photos : FlashPhotographs
        The rectified photographs in which they were found.

    Returns
    -------
    GratingSample
        Of the tiles' shape and pitch; the nearest points of the drawing.

    Raises
    ------
    InputError
        The sheet's size is not known.
    """
    if photos.sheet_mm is None:
        raise InputError("the size of the sheet is not known", expected="photos: a node with align.rectified")
    height, width = photos.valid.shape[1:]
    rows, columns = tiles.shape
    view = rectified(height, width, tiles.pixel_mm, np.zeros(3))
    seen = replace(view, homography=view.homography @ tiles.homographies[tiles.reference])
    place = seen.points(*np.meshgrid(np.arange(columns, dtype=float), np.arange(rows, dtype=float)))
    right, down = place[..., 0] + photos.sheet_mm[0] / 2, photos.sheet_mm[1] / 2 - place[..., 1]
    row, column = (np.floor(away / sample.pixel_mm).astype(int) for away in (down, right))
    shape = sample.orientation_rad.shape
    at = (row % shape[0], column % shape[1])
    return replace(
        sample,
        orientation_rad=sample.orientation_rad[at],
        period_um=sample.period_um[at],
        pixel_mm=tiles.pixel_mm,
    )
