"""Views: directions, pixels and their solid angles."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rfgen_sionna.pir.projection import PROJECTIONS, ImagePlane, Projection
from rfgen_sionna.pir.render import check_view
from rfgen_sionna.pir.view import View
from rfgen_sionna.radar.pose import rotation_matrix

TURNED = (0.3, -0.2, 0.1)


@pytest.mark.parametrize("fov_deg", [(60.0, 60.0), (90.0, 40.0)])
def test_solid_angles_add_up_to_the_field_of_view(fov_deg: tuple[float, float]) -> None:
    """That of a rectangular pyramid, whose sides have tangents a and b; the midpoint rule errs by
    the square of a pixel."""
    view = View((64, 48), fov_deg, (0.0, 0.0, 0.0), TURNED)
    a, b = np.tan(np.radians(fov_deg) / 2)
    expected = 4 * np.arctan(a * b / np.sqrt(1 + a**2 + b**2))
    assert view.solid_angles.shape == (64, 48)
    assert view.solid_angles.sum() == pytest.approx(expected, rel=1e-3)
    assert view.solid_angles.max() == view.solid_angles[31:33, 23:25].max()


@pytest.mark.parametrize("fov_deg", [(360.0, 180.0), (120.0, 50.0)])
def test_solid_angles_of_an_equirectangular_view(fov_deg: tuple[float, float]) -> None:
    """A zone of the sphere; all around it is 4 pi."""
    view = View((64, 48), fov_deg, (0.0, 0.0, 0.0), TURNED, "equirectangular")
    azimuth, elevation = np.radians(fov_deg)
    assert view.solid_angles.sum() == pytest.approx(2 * azimuth * np.sin(elevation / 2), rel=1e-3)


@given(
    projection=st.sampled_from(PROJECTIONS),
    wide=st.floats(2, 178),
    high=st.floats(2, 178),
    yaw=st.floats(-3, 3),
    roll=st.floats(-3, 3),
)
def test_every_pixel_finds_its_own_direction(
    projection: Projection, wide: float, high: float, yaw: float, roll: float
) -> None:
    view = View((5, 7), (wide, high), (0.0, 0.0, 0.0), (yaw, 0.2, roll), projection)
    directions = view.directions
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1.0, rtol=1e-12)
    number = np.arange(35).reshape(5, 7)
    np.testing.assert_array_equal(view.pixels(3.0 * directions), number)
    rays, solid_angles, pixel = view.rays(1)
    np.testing.assert_allclose(rays, directions.reshape(-1, 3), atol=1e-14)
    np.testing.assert_allclose(solid_angles, view.solid_angles.ravel(), rtol=1e-12)
    np.testing.assert_array_equal(view.pixels(directions.reshape(-1, 3)), pixel)


def test_an_equirectangular_view_is_even_in_azimuth_and_elevation() -> None:
    view = View((9, 18), (360.0, 180.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), "equirectangular")
    x, y, z = np.moveaxis(view.directions, -1, 0)
    np.testing.assert_allclose(np.degrees(np.arctan2(y, x))[4], 170.0 - 20.0 * np.arange(18), atol=1e-9)
    np.testing.assert_allclose(np.degrees(np.arcsin(z))[:, 3], 80.0 - 20.0 * np.arange(9), atol=1e-9)
    behind = view.pixels(np.array([-1.0, -0.1, 0.0]))
    assert divmod(int(behind), 18) == (4, 17)


@pytest.mark.parametrize("yaw", [0.0, 0.5 * np.pi])
def test_all_around_there_is_no_seam_and_no_hole(yaw: float) -> None:
    """Straight behind, up and down, and whatever rounding makes of them, are in the outermost pixels."""
    view = View((9, 18), (360.0, 180.0), (0.0, 0.0, 0.0), (yaw, 0.0, 0.0), "equirectangular")
    behind = np.array([[-1.0, y, 0.0] for y in (0.0, -0.0, -1e-17, 1e-17)]) @ rotation_matrix((yaw, 0.0, 0.0)).T
    for directions, row in ((behind, 4), (np.array([[0.0, 0.0, 1.0]]), 0), (np.array([[0.0, 0.0, -1.0]]), 8)):
        assert set(view.pixels(directions) // 18) == {row}
    assert set(view.pixels(behind) % 18) <= {0, 17}


def test_a_perspective_view_has_no_place_for_what_is_behind() -> None:
    flat = ImagePlane("perspective", (90.0, 90.0))
    assert np.isnan(flat.places(np.array([-1.0, 0.0, 0.0]))).all()
    np.testing.assert_allclose(flat.places(np.array([2.0, 2.0, -1.0])), (1.0, -0.5), atol=1e-12)


def test_square_pixels_and_allowed_fields_of_view() -> None:
    assert check_view((32, 64), 90.0, "equirectangular")[2] == (90.0, 45.0)
    assert check_view((32, 64), 90.0)[2] == pytest.approx((90.0, 2 * np.degrees(np.arctan(0.5))))
    assert check_view((32, 64), 360, "equirectangular")[2] == (360.0, 180.0)
    wrong: tuple[tuple[Any, str, str], ...] = (
        (180.0, "perspective", "fov_deg is 180.0: an angle above 0 and below 180"),
        (361.0, "equirectangular", "up to 360 degrees horizontally"),
        ((360.0, 181.0), "equirectangular", "and 180 vertically"),
        (360, "equirectangular", "360 degrees across are 360 from top to bottom with 64 x 64 square pixels"),
        (0.0, "equirectangular", "above 0"),
        ((60.0, np.nan), "perspective", "fov_deg"),
        (True, "perspective", "fov_deg is True"),
        ("wide", "perspective", "fov_deg is 'wide'"),
        (60.0, "fisheye", "projection is 'fisheye': 'perspective' or 'equirectangular'"),
    )
    for fov, projection, words in wrong:
        with pytest.raises(ValueError, match=words):
            check_view((64, 64), fov, projection)
