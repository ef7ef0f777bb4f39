"""Views: directions, pixels and their solid angles."""

from __future__ import annotations

import numpy as np
import pytest

from rfgen_sionna.pir.view import View


@pytest.mark.parametrize("fov_deg", [(60.0, 60.0), (90.0, 40.0)])
def test_solid_angles_add_up_to_the_field_of_view(fov_deg: tuple[float, float]) -> None:
    """That of a rectangular pyramid, whose sides have tangents a and b; the midpoint rule errs by
    the square of a pixel."""
    view = View((64, 48), fov_deg, (0.0, 0.0, 0.0), (0.3, -0.2, 0.1))
    a, b = np.tan(np.radians(fov_deg) / 2)
    expected = 4 * np.arctan(a * b / np.sqrt(1 + a**2 + b**2))
    assert view.solid_angles.shape == (64, 48)
    assert view.solid_angles.sum() == pytest.approx(expected, rel=1e-3)
    assert view.solid_angles.max() == view.solid_angles[31:33, 23:25].max()
