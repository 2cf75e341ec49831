"""A compact disc: tracks around its centre, under 1.2 mm of polycarbonate that is seen at an angle."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import GratingSample
from pipeline.devices.drawn_sample import blank, foreseen, undrawable
from pipeline.errors import InputError
from pipeline.limits import above_zero, refuse, within, zero_or_more
from pipeline.optics.drawing import Drawing, azimuth, polar, ray
from pipeline.optics.substrates import face_transmission_ratio, plate_retardation, towards
from pipeline.parallel import over_rows

Float64Array = NDArray[np.float64]

TRACKS_FROM_MM = 22.5
"""Radius at which the tracks begin."""
PRINT_MM = (23.5, 26.5)
"""Radii between which the inner ring is printed."""

_HUB_MM = 7.5
_THICKNESS_UM = 1200.0
_INDEX = 1.58
_LARGEST_BIREFRINGENCE = 0.01
_MARK_DEG = 1.5
_SCRATCH_MM = 0.08


def compact_disc(
    *,
    width_mm: float = 100.0,
    margin_mm: float = 1.03,
    pixel_mm: float = 0.042,
    period_um: float = 1.6,
    depth_um: float = 0.12,
    amplitude_ratio: float = 1.001,
    phase_deg: float = 170.0,
    camera_mm: list[float] | None = [60.0, 0.0, 800.0],  # noqa: B006 - read from the syntax tree, never modified
    in_plane_birefringence: tuple[float, ...] = (1.2e-5, 1.7e-5),
    vertical_birefringence: float = 6.5e-4,
    wavelength_nm: float = 530.0,
    print_reflectance: float = 0.5,
    scratches: int = 12,
    ground_reflectance: float = 0.03,
    seed: int = 0,
) -> GratingSample:
    """Draw the middle of an unwritten disc: tracks as a grating that diffracts along the radius.

    The tracks run around the hub, so they diffract towards and away from it: the orientation is the direction in
    which a point lies from the centre (the spiral's own slant is below 0.001 degrees). Inside 22.5 mm, where hub hole,
    clamping area and inner rim are, nothing diffracts.

    What makes a real disc hard is on by default and goes away one by one:

    - ``amplitude_ratio`` 1.001 and ``phase_deg`` 170 make the modulation weak: the middle of figure 15's range, 164 to
      176 (see also section 7.3).
    - ``camera_mm``: the camera stands 0.8 m above the disc and beside the panel, so the light that it sees arrives at 4
      degrees at the hub and up to 8 at the rim; the plate's face then passes more light along the plane of incidence
      than across it, which changes ``r``, and the path in the plate grows. None: at a right angle everywhere.
    - ``in_plane_birefringence``: moulding leaves the plate birefringent, with its axis along the radius, unevenly from
      the inner to the outer edge. (0, 0): none.
    - ``vertical_birefringence``: the index along the normal is lower, which retards light that comes at an angle. 0:
      none.
    - ``print_reflectance``: marks printed over the inner tracks, through which they are still seen, as a veil of
      unpolarised light. 0: none.
    - ``scratches``: lines that scatter as brightly as the disc reflects. 0: none.

    Parameters
    ----------
    width_mm, margin_mm : float
        Diameter of the region, and width of the masked ground around it.
    pixel_mm : float
        Pitch of the map; a third of the camera's in ``rig=polarization_disc_simulated``.
    period_um : float
        Pitch of the tracks; that of ECMA-130, clause 11.
    depth_um : float
        Depth of the grooves.
    amplitude_ratio, phase_deg : float
        ``R = r exp(i zeta)`` of the zeroth order at normal incidence.
    camera_mm : [x, y, z], optional
        Place of the camera.
    in_plane_birefringence : tuple of float
        Index along the tracks less that across them, at the inner and at the outer edge of the region; linear between.
    vertical_birefringence : float
        Index in the plane less that along the normal.
    wavelength_nm : float
        Of the filter.
    print_reflectance : float
        Of the marks, relative to the zeroth order.
    scratches : int
        How many.
    ground_reflectance : float
        Of what does not diffract.
    seed : int
        Of marks and scratches.

    Returns
    -------
    GratingSample
        Map of (width + 2 margin) / pixel points a side; ``amplitude_ratio``, ``retardation_rad``, ``film_axis_rad``
        and ``veil`` are maps.

    Raises
    ------
    InputError, InputErrors
        A region that ends inside the first track, impossible numbers, or a map too large to draw.

    Notes
    -----
    ``r`` is resolved along the grating's own axes, which is exact where the plane of incidence lies along or across
    them.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018), section
    7.3 and figure 25. The birefringences are those that Fu, Mansuripur and Lam measured between 360 and 860 nm (Applied
    Optics 33, 7406, 1994): 1.2e-5 to 1.7e-5 in the plane, 5.7e-4 to 7.5e-4 vertically.
    """
    _check_compact_disc(
        width_mm=width_mm,
        margin_mm=margin_mm,
        pixel_mm=pixel_mm,
        period_um=period_um,
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        camera_mm=camera_mm,
        in_plane_birefringence=in_plane_birefringence,
        vertical_birefringence=vertical_birefringence,
        wavelength_nm=wavelength_nm,
        print_reflectance=print_reflectance,
        scratches=scratches,
        ground_reflectance=ground_reflectance,
        seed=seed,
    )
    drawing = blank(width_mm=width_mm, margin_mm=margin_mm, pixel_mm=pixel_mm)
    drawing.annulus((0.0, 0.0), (TRACKS_FROM_MM, width_mm / 2), azimuth(), period_um)
    rng = np.random.default_rng(seed)
    printed = rng.random((2, round(360 / _MARK_DEG))) < 0.5
    ratio, retardation, axis, veil = (np.empty_like(drawing.period_um) for _ in range(4))
    edges = [TRACKS_FROM_MM, width_mm / 2]
    camera = [0.0, 0.0, np.inf] if camera_mm is None else camera_mm

    def fill(start: int, stop: int) -> None:
        rows = slice(start, stop)
        x, y = drawing.x_mm[None, :], drawing.y_mm[rows, None]
        radius, direction = np.hypot(x, y), azimuth()(x, y)
        incidence = towards(camera, x, y)
        retardation[rows], axis[rows] = plate_retardation(
            incidence,
            thickness_um=_THICKNESS_UM,
            index=_INDEX,
            wavelength_nm=wavelength_nm,
            in_plane=np.interp(radius, edges, in_plane_birefringence),
            axis_rad=direction,
            vertical=vertical_birefringence,
        )
        excess = face_transmission_ratio(incidence, _INDEX) - 1
        ratio[rows] = amplitude_ratio * (1 - excess * np.cos(2 * (incidence.azimuth_rad - direction)))
        veil[rows] = print_reflectance * _inked(radius, direction, printed)

    over_rows(fill, drawing.columns, tile=32)
    veil += _scratched(drawing, scratches, width_mm / 2, rng)
    return GratingSample(
        orientation_rad=drawing.orientation_rad,
        period_um=drawing.period_um,
        pixel_mm=pixel_mm,
        depth_um=depth_um,
        amplitude_ratio=ratio,
        phase_rad=float(np.deg2rad(phase_deg)),
        retardation_rad=retardation,
        film_axis_rad=axis,
        ground_reflectance=ground_reflectance,
        name="compact disc",
        veil=veil,
    )


def _inked(radius: Float64Array, direction: Float64Array, printed: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where marks lie on the inner ring: two lines of places around it, each ``printed`` or not, as in a code."""
    low, high = PRINT_MM
    line = np.clip(2 * (radius - low) / (high - low), 0, 1.999)
    place = np.mod(np.rad2deg(direction), 360) / _MARK_DEG
    inked = (line % 1 > 0.15) & (line % 1 < 0.85) & (radius > low) & (radius < high)
    return inked & printed[line.astype(int), place.astype(int) % printed.shape[1]]


def _scratched(drawing: Drawing, count: int, rim_mm: float, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Where straight scratches run, from places on the tracks, of lengths and in directions by chance."""
    lines = Drawing(drawing.columns, drawing.pixel_mm)
    for _ in range(count):
        start = polar(rng.uniform(TRACKS_FROM_MM, rim_mm), rng.uniform(0.0, 360.0))
        stop = rng.uniform(0.1, 0.4) * rim_mm
        lines.polygon(ray((0.0, stop), rng.uniform(0.0, 360.0), _SCRATCH_MM, start), 0.0, 1.0)
    radius = np.hypot(drawing.x_mm[None, :], drawing.y_mm[:, None])
    return np.isfinite(lines.orientation_rad) & (radius > _HUB_MM) & (radius < rim_mm)


_foresee_compact_disc = foreseen


def _check_compact_disc(
    *,
    width_mm: float,
    period_um: float,
    camera_mm: list[float] | None,
    in_plane_birefringence: tuple[float, ...],
    vertical_birefringence: float,
    wavelength_nm: float,
    print_reflectance: float,
    scratches: int,
    seed: int,
    **common: Any,
) -> None:
    """Refuse what cannot be drawn, before anything runs."""
    problems = []
    if 0 < width_mm <= 2 * TRACKS_FROM_MM:
        right = f"above {2 * TRACKS_FROM_MM:g}, where the tracks begin"
        problems.append(InputError(f"width_mm is {width_mm:g}", where="width_mm", expected=right))
    if camera_mm is not None and (len(camera_mm) != 3 or camera_mm[2] <= 0):
        right = "[x, y, z] in mm, z above the disc's 0, or null"
        problems.append(InputError(f"camera_mm is {camera_mm}", where="camera_mm", expected=right))
    if len(in_plane_birefringence) != 2 or max(map(abs, in_plane_birefringence)) > _LARGEST_BIREFRINGENCE:
        right = f"two differences of indices, inner and outer, of at most {_LARGEST_BIREFRINGENCE:g}"
        problems.append(
            InputError(
                f"in_plane_birefringence is {list(in_plane_birefringence)}",
                where="in_plane_birefringence",
                expected=right,
            )
        )
    refuse(
        problems,
        above_zero(period_um=period_um, wavelength_nm=wavelength_nm),
        within(-_LARGEST_BIREFRINGENCE, _LARGEST_BIREFRINGENCE, vertical_birefringence=vertical_birefringence),
        zero_or_more(print_reflectance=print_reflectance, scratches=scratches, seed=seed),
        undrawable(width_mm=width_mm, **common),
    )
