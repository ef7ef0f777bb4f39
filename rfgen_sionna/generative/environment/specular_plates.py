"""Specular plate returns: walls, floors, ceilings and doors at normal incidence.

Such a return fills a few pixels and exceeds its surroundings; a small network smears it. It follows from the layout map
by image theory for a flat face, with the Fresnel integrals of its extent. Furniture has none, since boxes do not give
its flatness; windows have none, since frame and pane are coplanar.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import fresnel

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.generative.environment.layout_map import LayoutMap
from rfgen_sionna.generative.environment.primitives import PrimitiveScene
from rfgen_sionna.pir.view import View
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.furnished.finishes import surface_material
from rfgen_sionna.tracing.gains.diffuse import reflectance

_NEAREST = 0.05
"""Least distance of a face [m]; below, the far-field form fails."""
_NO_MIRRORS = ("window",)
"""Parts of the shell without specular return."""


class SpecularReturns(NamedTuple):
    """Specular returns of a view, (row, column)."""

    energy: FloatArray
    """|gain|² for isotropic elements; 0 elsewhere."""
    range: FloatArray
    """[m]; 0 elsewhere."""


@cache
def training_frequency() -> float:
    """Frequency of the training data [Hz]: middle of the AWR1843's band."""
    return Radar.load("awr1843").center_frequency


def specular_plate_returns(place: PrimitiveScene, layout_map: LayoutMap, view: View) -> SpecularReturns:
    """Specular plate returns of a view.

    A face of Fresnel reflectance |Γ|² and scattering coefficient S at distance d returns

        (λ / (8 π d))² |Γ|² (1 − S²) |F|²

    if it contains the foot of the perpendicular. F is the product of the Fresnel integrals over both sides, 1 for an
    infinite plate. The four pixels around the foot share the return by squared bilinear weights.

    Args:
        place: the place.
        layout_map: of `view`; gives the visibility of a foot.
        view: in the world of the place.
    """
    energy, reach = np.zeros(view.size), np.zeros(view.size)
    shell = place.parts[: place.shell]  # one box each
    own = np.einsum("bij,bj->bi", shell.axes, np.asarray(view.position) - shell.centre)
    wavelength = SPEED_OF_LIGHT / training_frequency()
    for side in range(3):
        others = [axis for axis in range(3) if axis != side]
        distance = np.abs(own[:, side]) - shell.half[:, side]
        above = (np.abs(own[:, others]) <= shell.half[:, others]).all(axis=1)
        for piece in np.flatnonzero(above & (distance > _NEAREST)).tolist():
            if place.kinds[piece] in _NO_MIRRORS:
                continue
            pixel, share = _around(view, -np.sign(own[piece, side]) * shell.axes[piece, side])
            there = layout_map.piece.ravel()[pixel] == piece
            if not there.any():
                continue
            ends = np.stack([-shell.half[piece, others], shell.half[piece, others]]) - own[piece, others]
            sines, cosines = fresnel(2.0 / np.sqrt(wavelength * distance[piece]) * ends)
            gain = np.prod(np.diff(cosines + 1j * sines, axis=0) / (1.0 + 1.0j))
            mirror = (wavelength / (8.0 * np.pi * distance[piece])) ** 2 * abs(gain) ** 2
            mirror *= _coherent(place.finishes.get(place.kinds[piece], ""))
            energy[pixel[there]], reach[pixel[there]] = (mirror * share)[there], distance[piece]
    return SpecularReturns(energy.reshape(view.resolution), reach.reshape(view.resolution))


def _around(view: View, direction: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
    """At most four pixels around a direction (3,), and their shares."""
    row, column = (float(x) for x in view.coordinates(direction))
    if not (-0.5 <= row < view.resolution[0] - 0.5 and -0.5 <= column < view.resolution[1] - 0.5):
        return np.zeros(0, np.intp), np.zeros(0)
    top, left = np.floor(row), np.floor(column)
    rows, columns = np.array([top, top, top + 1, top + 1]), np.array([left, left + 1, left, left + 1])
    weight = ((1 - abs(rows - row)) * (1 - abs(columns - column))) ** 2
    inside = (rows >= 0) & (rows < view.resolution[0]) & (columns >= 0) & (columns < view.resolution[1])
    pixel = (rows * view.resolution[1] + columns)[inside].astype(np.intp)
    return pixel, weight[inside] / weight[inside].sum()


@cache
def _coherent(finish: str) -> float:
    """(1 − S²) |Γ|² at normal incidence; 0 for an unknown finish."""
    if not finish:
        return 0.0
    made_of = surface_material(finish, training_frequency())
    return float((1.0 - made_of.scattering_coefficient**2) * reflectance(made_of, training_frequency(), np.ones(1))[0])
