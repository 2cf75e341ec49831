"""The values that stages hand to each other.

Small frozen dataclasses. Arrays are indexed (row, column[, channel]) with row 0 at the top of the photograph; in-plane
angles are anticlockwise from +x with y up, as seen in the displayed photograph. Lengths carry their unit in the name.
Fields may be arrays, ``str``, ``int``, ``float``, ``bool``, ``None``, and tuples or string-keyed dicts of these.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.floating]
BoolArray = NDArray[np.bool_]

SIMULTANEOUS = "simultaneous"
"""Key in a sequence's metadata that says ``yes`` where one exposure gave all photographs, so that none can be moved."""


@dataclass(frozen=True, eq=False)
class GratingSample:
    """A printed holographic sample, known exactly because it was drawn.

    Attributes
    ----------
    orientation_rad : ndarray of shape (M, N), float32
        Orientation of the grating's tangent (the direction in which it diffracts), in [0, pi); NaN on the ground.
    period_um : ndarray of shape (M, N), float32
        Grating period; NaN on the ground.
    pixel_mm : float
        Pitch of this map; finer than any camera that photographs it.
    depth_um : float
        Peak-to-valley depth of the sinusoidal profile.
    amplitude_ratio, phase_rad : float or ndarray of shape (M, N), float32
        ``R = r exp(i zeta)``, complex ratio of s to p amplitude in the zeroth order.
    retardation_rad : float or ndarray of shape (M, N), float32
        Retardation of one pass through the protective film.
    film_axis_rad : float or ndarray of shape (M, N), float32
        Direction of the film's optical axis.
    ground_reflectance : float
        Unpolarised reflectance of the ground relative to the zeroth order of the longest period.
    name : str
        What is drawn.
    veil : float or ndarray of shape (M, N), float32
        Unpolarised reflectance of what lies over all of it, as print and scratches, relative to the same.
    """

    orientation_rad: FloatArray
    period_um: FloatArray
    pixel_mm: float
    depth_um: float
    amplitude_ratio: float | FloatArray
    phase_rad: float | FloatArray
    retardation_rad: float | FloatArray
    film_axis_rad: float | FloatArray
    ground_reflectance: float
    name: str
    veil: float | FloatArray = 0.0

    @property
    def diffracts(self) -> BoolArray:
        """Where the sample carries a grating, shape (M, N)."""
        return np.isfinite(self.orientation_rad)


@dataclass(frozen=True, eq=False)
class Photo:
    """One linear photograph.

    Attributes
    ----------
    image : ndarray of shape (M, N) or (M, N, 3), float32
        Linear signal; 1 is the sensor's full scale.
    saturated : ndarray of shape (M, N), bool
        Pixels at or above full scale.
    exposure_s : float or None
        Exposure time.
    metadata : dict of str to str
        What the camera said about itself (model, ISO, aperture, ...).
    """

    image: FloatArray
    saturated: BoolArray
    exposure_s: float | None = None
    metadata: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class PolarizerPhoto:
    """One photograph through a polariser.

    Attributes
    ----------
    photo : Photo
        The photograph.
    polarizer_rad : float
        Where the polariser stood.
    """

    photo: Photo
    polarizer_rad: float


@dataclass(frozen=True, eq=False)
class PolarizerSequence:
    """Photographs of one scene through a linear polariser at several angles.

    Attributes
    ----------
    images : ndarray of shape (K, M, N), float32
        Linear photographs; 1 is the sensor's full scale.
    polarizer_rad : ndarray of shape (K,), float64
        Angle of the polariser's transmitted direction in each photograph.
    valid : ndarray of shape (M, N), bool
        Pixels inside the photographer's mask that are finite and unsaturated in every photograph.
    pixel_mm : float or None
        Pixel pitch on the sample.
    wavelength_nm : float or None
        Centre of the spectral filter.
    exposure_s : tuple of float or None
        Exposure time of each photograph.
    metadata : dict of str to str
        What the camera said about itself.
    """

    images: FloatArray
    polarizer_rad: FloatArray
    valid: BoolArray
    pixel_mm: float | None = None
    wavelength_nm: float | None = None
    exposure_s: tuple[float, ...] | None = None
    metadata: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class OrientationMap:
    """Orientation of the grating's tangent at every pixel.

    Attributes
    ----------
    orientation_rad : ndarray of shape (M, N), float32
        In [0, pi); NaN outside ``mask``.
    correlation : ndarray of shape (M, N), float32
        Normalised correlation of the fitted model with the photographs, in [0, 1]; NaN outside ``mask``, and everywhere
        where the photographs are no more than the model's unknowns.
    intensity : ndarray of shape (M, N), float32
        Mean over the photographs, full scale 1.
    mask : ndarray of shape (M, N), bool
        Pixels that diffract.
    pixel_mm : float or None
        Pixel pitch on the sample.
    absolute : bool
        False where the map is known only up to one offset, the same for every pixel.
    standard_error_rad : ndarray of shape (M, N), float32, or None
        Standard error of the orientation as the fit states it; NaN outside ``mask``.
    parameters : dict of str to float
        What the fit found that the whole sample has in common: each name ends in its unit.
    stokes : ndarray of shape (P, 2), float32, or None
        Relative Stokes parameters ``(s1, s2)`` of some of the pixels, where the fit found their curve.
    """

    orientation_rad: FloatArray
    correlation: FloatArray
    intensity: FloatArray
    mask: BoolArray
    pixel_mm: float | None = None
    absolute: bool = False
    standard_error_rad: FloatArray | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    stokes: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class PeriodMap:
    """Grating period at every pixel.

    Attributes
    ----------
    period_um : ndarray of shape (M, N), float32
        NaN outside ``mask``.
    mask : ndarray of shape (M, N), bool
        Pixels that diffract.
    pixel_mm : float or None
        Pixel pitch on the sample.
    relative : bool
        True where only ratios of periods were measured and the longest was given.
    """

    period_um: FloatArray
    mask: BoolArray
    pixel_mm: float | None = None
    relative: bool = True


@dataclass(frozen=True, eq=False)
class PictureSeries:
    """Colour pictures of one sample under a point light at several places.

    Attributes
    ----------
    rgb : ndarray of shape (L, M, N, 3), float32
        Linear, sRGB primaries, white (1, 1, 1).
    light_mm : ndarray of shape (L, 3), float64
        Position of the light: x right, y up, z towards the camera, origin at the centre of the sample.
    camera_mm : ndarray of shape (3,), float64
        Position of the camera in the same frame.
    pixel_mm : float or None
        Pixel pitch on the sample.
    caption : str
        What the pictures show.
    """

    rgb: FloatArray
    light_mm: FloatArray
    camera_mm: FloatArray
    pixel_mm: float | None = None
    caption: str = ""


@dataclass(frozen=True, eq=False)
class OrientationError:
    """Signed difference between an estimated orientation and the truth.

    Attributes
    ----------
    error_rad : ndarray of shape (M, N), float32
        Estimate minus truth minus offset, in [-pi/2, pi/2); NaN where either is masked.
    offset_rad : float
        The one offset removed from every pixel.
    metrics : dict of str to float
        Figures for the table: each name ends in its unit.
    """

    error_rad: FloatArray
    offset_rad: float
    metrics: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class PolarizerResponse:
    """Intensity behind the polariser for every angle of it and every orientation of the grating.

    Attributes
    ----------
    intensity : ndarray of shape (T, P), float64
        A row an orientation, a column an angle of the polariser; 1 is a grating with R = 1 without a film.
    polarizer_rad : ndarray of shape (P,), float64
        Equal steps over [0, pi).
    orientation_rad : ndarray of shape (T,), float64
        Equal steps over [0, pi).
    row_maximum_rad : ndarray of shape (T,), float64
        Angle of the polariser at which each row is brightest, in [0, pi); NaN where it is flat.
    amplitude_ratio, phase_rad : float
        ``R = r exp(i zeta)``, complex ratio of s to p amplitude in the zeroth order.
    retardation_rad, film_axis_rad : float
        Retardation of one pass through the film, and the direction of its optical axis.
    offset_rad : float or None
        Of the line ``psi = theta + offset`` on which the row maxima lie without a film; None where there are none.
    label : str
        What the map shows.
    prenormalized : bool
        True where each column's mean over the orientations has been subtracted.
    """

    intensity: FloatArray
    polarizer_rad: FloatArray
    orientation_rad: FloatArray
    row_maximum_rad: FloatArray
    amplitude_ratio: float
    phase_rad: float
    retardation_rad: float
    film_axis_rad: float
    offset_rad: float | None
    label: str
    prenormalized: bool = False


@dataclass(frozen=True, eq=False)
class LineDeviation:
    """How far the row maxima of a polariser's response lie from a straight line.

    Attributes
    ----------
    orientation_rad : ndarray of shape (T,), float64
        Orientation of each row.
    deviation_rad : ndarray of shape (T,), float64
        Row maximum minus orientation minus offset, in [-pi/2, pi/2); NaN where a row is flat.
    prenormalized_rad : ndarray of shape (T,), float64
        The same after pre-normalisation, from its own line; NaN where that was not asked for.
    metrics : dict of str to float
        Figures for the table: each name ends in its unit, where it has one.
    """

    orientation_rad: FloatArray
    deviation_rad: FloatArray
    prenormalized_rad: FloatArray
    metrics: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class HeightField:
    """Heights of a surface over a plane, on square pixels.

    Attributes
    ----------
    height_um : ndarray of shape (M, N), float32 or float64
        Up, from any zero; NaN where it is not known. Row 0 is the one of largest y, so x goes right and y up.
    pitch_um : float
        Distance of neighbouring samples.
    periodic : bool
        True where the surface goes on as this tile repeated, N pitches wide and M high.
    caption : str
        What it is, and where it comes from.
    """

    height_um: FloatArray
    pitch_um: float
    periodic: bool = False
    caption: str = ""


@dataclass(frozen=True, eq=False)
class Periodicity:
    """Periods of a surface and their directions, that of most variance first; none where K is 0.

    Attributes
    ----------
    period_um, period_error_um : ndarray of shape (K,), float64
        Period and its standard error, which is 0 for whole cycles of a tile that repeats.
    direction_rad, direction_error_rad : ndarray of shape (K,), float64
        Direction in which it repeats, across the lines, in [0, pi); and its standard error.
    rms_um : ndarray of shape (K,), float64
        Root mean square height of what repeats so.
    contrast : ndarray of shape (K,), float64
        Of the peak over the spectrum around it.
    spread : ndarray of shape (K,), float64
        Width of the peak over its frequency: by how much the period varies; 0 where the whole map swings in step.
    power_um2 : ndarray of shape (2 m + 1, 2 n + 1), float32
        Spectrum of the heights around frequency 0, row 0 at the highest y.
    step_per_um : tuple of float
        Frequency from bin to bin along x and y.
    metrics : dict of str to float
        Figures for the table: each name ends in its unit, where it has one.
    """

    period_um: FloatArray
    period_error_um: FloatArray
    direction_rad: FloatArray
    direction_error_rad: FloatArray
    rms_um: FloatArray
    contrast: FloatArray
    spread: FloatArray
    power_um2: FloatArray
    step_per_um: tuple[float, float]
    metrics: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class BrdfMap:
    """How a surface shines in all directions, relative to a mirror at normal incidence.

    Attributes
    ----------
    rgb : ndarray of shape (L, M, M, 3), float32
        Linear sRGB over discs of directions of view, whose pixel (row, column) looks along (x, y) of the disc with y up
        and the edge at grazing view; 0 outside.
    light : ndarray of shape (L, 3), float64
        Unit vectors towards the light.
    evaluator : str
        How the response was found.
    caption : str
        Of what surface.
    metrics : dict of str to float
        Figures for the table: each name ends in its unit, where it has one.
    """

    rgb: FloatArray
    light: FloatArray
    evaluator: str = ""
    caption: str = ""
    metrics: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Pictures:
    """Pictures of one scene, each with what it shows.

    Attributes
    ----------
    rgb : ndarray of shape (K, M, N, 3), float32
        Linear sRGB, relative to a white matt surface that faces the light; 0 where there is nothing.
    labels : tuple of str
        What each shows.
    caption : str
        Of what.
    """

    rgb: FloatArray
    labels: tuple[str, ...]
    caption: str = ""


@dataclass(frozen=True, eq=False)
class DiffractionPeaks:
    """How bright a surface is in the plane of incidence, and where an order of diffraction is brightest.

    Angles of view are signed: negative on the other side of the normal than the light.

    Attributes
    ----------
    wavelength_nm : ndarray of shape (L,), float64
        Wavelengths.
    view_rad : ndarray of shape (A,), float64
        Angles of view.
    response : ndarray of shape (L, A), float32
        Relative to a mirror in its direction.
    peak_rad : ndarray of shape (L,), float64
        Angle at which the order is brightest; NaN where no peak stands out.
    period_um : ndarray of shape (L,), float64
        Period that each peak gives; NaN where there is none.
    light_rad, azimuth_rad : float
        The light's angle from the normal, and the direction of the plane, anticlockwise from +x.
    order : int
        Order of diffraction; above 0 on the light's side of the mirror's direction.
    near_um : float
        Period around which peaks were looked for; NaN if none was known or found.
    evaluator, caption : str
        How the response was found, and of what surface.
    metrics : dict of str to float
        Figures for the table: each name ends in its unit, where it has one.
    """

    wavelength_nm: FloatArray
    view_rad: FloatArray
    response: FloatArray
    peak_rad: FloatArray
    period_um: FloatArray
    light_rad: float
    azimuth_rad: float
    order: int
    near_um: float
    evaluator: str
    caption: str
    metrics: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class SlitPatterns:
    """What a row of slits throws on a screen far away, for several numbers of slits.

    Attributes
    ----------
    position_mm : ndarray of shape (X,), float64
        Places on the screen, from the middle.
    slits : ndarray of shape (K,), int64
        Numbers of slits.
    intensity : ndarray of shape (K, X), float32
        Of light of one wavelength, relative to the middle.
    white_rgb : ndarray of shape (K, X, 3), float32
        Linear sRGB under white light; the middle is white.
    wavelength_nm : float
        Of the light of one wavelength.
    caption : str
        Slits and screen.
    metrics : dict of str to float
        Figures for the table: each name ends in its unit, where it has one.
    """

    position_mm: FloatArray
    slits: NDArray[np.integer]
    intensity: FloatArray
    white_rgb: FloatArray
    wavelength_nm: float
    caption: str
    metrics: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Metrics:
    """Figures for the table: each name ends in its unit."""

    metrics: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Defects:
    """Fabrication defects of an item, found or known, in the frame of the product without defects.

    Attributes
    ----------
    kind : tuple of str
        ``missing`` (no grating where there should be one), ``scratch`` (missing along a line), ``extra`` (a grating
        where there should be none), ``turned`` or ``period``, for each of the D defects.
    centre_mm : ndarray of shape (D, 2), float64
        Centre of its area: x right, y up, origin at the centre of the map.
    area_mm2, width_mm : ndarray of shape (D,), float64
        Area, and the largest distance between two of its points.
    turn_rad : ndarray of shape (D,), float64
        By how much the grating is turned, anticlockwise, in [-pi/2, pi/2); NaN without a grating.
    period_ratio : ndarray of shape (D,), float64
        Its period over that of the product; NaN without a grating.
    significance : ndarray of shape (D,), float64
        In standard deviations of the noise over the defect's own area; NaN where it is known because it was drawn.
    labels : ndarray of shape (M, N), int32
        Which pixel belongs to which defect: k + 1 for defect k, 0 for none.
    pixel_mm : float
        Pitch of the labels.
    """

    kind: tuple[str, ...]
    centre_mm: FloatArray
    area_mm2: FloatArray
    width_mm: FloatArray
    turn_rad: FloatArray
    period_ratio: FloatArray
    significance: FloatArray
    labels: NDArray[np.int32]
    pixel_mm: float


@dataclass(frozen=True, eq=False)
class Inspection:
    """An item compared with a reference item of the same product.

    Attributes
    ----------
    defects : Defects
        What was found, the most significant first, in the frame of the reference.
    suspect : OrientationMap
        The item's map brought onto the reference: moved, turned back, and without the offset between the two.
    significance : ndarray of shape (M, N), float32
        Largest deviation of the grating over all kinds and scales, in standard deviations of the noise; NaN where
        nothing can be judged.
    threshold : float
        The significance that noise alone is not expected to reach.
    shift_mm : ndarray of shape (2,), float64
        Where the centre of the reference lies in the item's photograph: x right, y up.
    turn_rad : float
        By how much the item lies turned, anticlockwise.
    offset_rad : float
        By how much the item's orientations stand ahead of the reference's beyond that, in [-pi/2, pi/2).
    metrics : dict of str to float
        Figures for the table: each name ends in its unit.
    """

    defects: Defects
    suspect: OrientationMap
    significance: FloatArray
    threshold: float
    shift_mm: FloatArray
    turn_rad: float
    offset_rad: float
    metrics: Mapping[str, float]
