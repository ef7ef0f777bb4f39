"""Mirror flashes: what walls, floors, ceilings and doors return where they are met at right angles.

A flash fills a few pixels of an image at most, and outshines what lies around it. A small network smears it; what it
must be follows from the sketch of a place: image theory for a flat face, with the Fresnel integrals of its extent.
Pieces of furniture have none of ours: the boxes around them say too little of how flat they are, nor do windows, of
which frame and pane are flat together.
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
"""Faces nearer than this have none [m]."""
_NO_MIRRORS = ("window",)
"""Of the shell."""


class SpecularReturns(NamedTuple):
    """Of a view, (row, column)."""

    energy: FloatArray
    """Isotropic |gain|^2; 0 where there is none."""
    range: FloatArray
    """[m]; 0 where there is none."""


@cache
def training_frequency() -> float:
    """Of what the models learn from [Hz]: the middle of the AWR1843's band."""
    return Radar.load("awr1843").center_frequency


def specular_plate_returns(place: PrimitiveScene, layout_map: LayoutMap, view: View) -> SpecularReturns:
    """The flashes that a view of a place of bricks shows.

    A face of Fresnel reflectance |Gamma|^2 and scattering coefficient S whose plane lies at the distance d returns

        (lambda / (8 pi d))^2 |Gamma|^2 (1 - S^2) |F|^2

    if the foot of the perpendicular is on it. F is the product, over its two sides, of the Fresnel integrals from one
    end to the other, 1 for a side without end. The four pixels around the foot share it by the squares of bilinear
    weights, as far as they show the same piece.

    Args:
        place: the place.
        sketch: what `view` shows of it: what hides a foot hides its flash.
        view: in the world of the place.
    """
    energy, reach = np.zeros(view.size), np.zeros(view.size)
    shell = place.parts[: place.shell]  # one box a piece
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
    """Pixels of the view around a direction (3,), four at most, and each one's share of what comes from there."""
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
    """(1 - S^2) |Gamma|^2 at normal incidence; 0 of what isn't known."""
    if not finish:
        return 0.0
    made_of = surface_material(finish, training_frequency())
    return float((1.0 - made_of.scattering_coefficient**2) * reflectance(made_of, training_frequency(), np.ones(1))[0])
