"""A birefringent plate, seen obliquely."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics.jones import retarder
from pipeline.optics.substrates import Incidence, face_transmission_ratio, plate_retardation, towards

PLATE = {"thickness_um": 1200.0, "index": 1.58, "wavelength_nm": 530.0}
ANGLES = st.floats(-3, 3)


def coming(angle_deg: float, azimuth_deg: float = 0.0) -> Incidence:
    return Incidence(np.asarray(np.deg2rad(angle_deg)), np.asarray(np.deg2rad(azimuth_deg)))


def test_incidence_is_that_of_the_camera_s_mirror_image() -> None:
    seen = towards([60.0, 0.0, 800.0], np.array([0.0, 60.0, 60.0]), np.array([0.0, 0.0, -80.0]))
    np.testing.assert_allclose(np.rad2deg(seen.angle_rad), [np.rad2deg(np.arctan(60 / 800)), 0.0, 5.7106], atol=1e-4)
    np.testing.assert_allclose(np.rad2deg(seen.azimuth_rad[[0, 2]]), [0.0, 90.0])
    assert towards([0.0, 0.0, np.inf], 40.0, -30.0).angle_rad == 0


def test_at_a_right_angle_the_retardation_is_that_of_the_plane() -> None:
    """1.2 mm with 1.45e-5, a typical disc between the wavelengths of Fu, Mansuripur and Lam: 17.4 nm, 11.8 degrees."""
    found, axis = plate_retardation(coming(0.0), in_plane=1.45e-5, axis_rad=0.4, vertical=6.5e-4, **PLATE)
    assert np.rad2deg(found) == pytest.approx(360 * 17.4 / 530)
    assert axis == pytest.approx(0.4)


def test_vertical_birefringence_is_that_of_the_index_ellipsoid() -> None:
    """Exact for a uniaxial plate: the extraordinary wave's index at an angle t to the axis, less the ordinary one."""
    angle, ordinary = np.deg2rad(20.0), 1.58
    normal = ordinary - 6.5e-4
    inside = np.arcsin(np.sin(angle) / ordinary)
    extraordinary = 1 / np.sqrt(np.cos(inside) ** 2 / ordinary**2 + np.sin(inside) ** 2 / normal**2)
    expected = 2 * np.pi / 0.53 * 1200 * (ordinary - extraordinary) / np.cos(inside)
    found, axis = plate_retardation(coming(20.0, 35.0), in_plane=0.0, axis_rad=0.0, vertical=6.5e-4, **PLATE)
    assert found == pytest.approx(expected, rel=2e-3)
    assert np.rad2deg(axis) == pytest.approx(35.0)


@given(ANGLES, ANGLES)
def test_thin_retarders_in_a_row_are_what_their_sum_is(first: float, second: float) -> None:
    """The product of the Jones matrices of many thin slices, of one anisotropy and of the other in turn."""
    incidence = Incidence(np.asarray(0.3), np.asarray(second))
    total, axis = plate_retardation(incidence, in_plane=1e-5, axis_rad=first, vertical=4e-4, **PLATE)
    parts = [
        plate_retardation(incidence, in_plane=1e-5, axis_rad=first, vertical=0.0, **PLATE),
        plate_retardation(incidence, in_plane=0.0, axis_rad=first, vertical=4e-4, **PLATE),
    ]
    slices = 400
    layer = retarder(parts[0][0] / slices, parts[0][1]) @ retarder(parts[1][0] / slices, parts[1][1])
    stack = np.linalg.matrix_power(layer, slices)
    phase = (total - parts[0][0] - parts[1][0]) / 2
    np.testing.assert_allclose(stack, retarder(total, axis) * np.exp(-1j * phase), atol=2e-3)


def test_the_face_passes_more_along_the_plane_of_incidence() -> None:
    """Born and Wolf, section 1.5: Fresnel's amplitudes, in and out."""
    i = np.deg2rad(30.0)
    t = np.arcsin(np.sin(i) / 1.58)
    p_in = 2 * np.sin(t) * np.cos(i) / (np.sin(i + t) * np.cos(i - t))
    s_in = 2 * np.sin(t) * np.cos(i) / np.sin(i + t)
    p_out = 2 * np.sin(i) * np.cos(t) / (np.sin(i + t) * np.cos(t - i))
    s_out = 2 * np.sin(i) * np.cos(t) / np.sin(i + t)
    assert face_transmission_ratio(coming(30.0), 1.58) == pytest.approx(p_in * p_out / (s_in * s_out))
    assert face_transmission_ratio(coming(0.0), 1.58) == 1
