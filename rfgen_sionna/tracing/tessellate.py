"""Splitting faces into facets, and facets into the parts that their integral takes, to the tolerance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from rfgen_sionna.records import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.scene.arrays import Frozen, drjit_types
from rfgen_sionna.scene.mesh import corners_of, lengths, middles, widest
from rfgen_sionna.scene.transfer import joined, upload
from rfgen_sionna.tracing.smooth import Bend, Smoothing

_MAX_SPLITS = 64
MAX_BULGE = 1.0
"""Phase bulge [rad] up to which an expansion to first order means anything."""
FACET_BULGE = 0.5
"""Phase bulge [rad] that a facet may have: those that need a smaller one are integrated in parts."""
STILL_BULGE = 1.0
"""The same of what stays: nothing turns, and what shadows cut of facets is known whatever their size."""
PATTERN, STILL_PATTERN = 0.5, 0.2
"""By how much, per unit of the tolerance, what the antennas make of a facet's points may differ from what its
middle and the rise there tell of them, relative to the largest: parts don't mend that, and facets alike repeat it. The
second is of what stays, smooth or not; the facets of bodies don't repeat it."""
_FINEST = 1e-4
"""Tolerance below which no facets are split for that: it goes with the square of their size, and what is made finer for
its phase takes parts."""
_LEAST_BULGE = 0.003
"""Phase bulge [rad] below which facets are not split for that either: patterns may have steps."""
_NONE = 1e-6
"""Gain that counts as none, relative to the largest."""
BAND_SWING = 4.0
"""Phase [rad] by which the band's ends turn the corners of a facet against each other, seen from its centre: it is then
two or three range cells deep at most, and a few coefficients follow its gain over the band."""
CURVED = 2.0
"""How much higher, as a phase, a smooth surface may rise over a part than a flat one's phase may bulge: it rises once,
where facets of a plate repeat their bulge."""
CUBIC = 0.03
"""Share of k L^3 / R^2 that the cubic phase over a facet of edge L comes to beside a quadratic one."""
BOWED = 0.02
"""Share of k h L / R that the rest comes to where a facet of edge L bows by h, aslant."""
TURN = 2.0
"""Angle [rad] by which a smooth surface may turn over a facet in which it turns out of sight, per root of the phase
bulge allowed: its return ends there with a kink, that goes with the angle's square."""
MAX_PARTS = 8
"""Largest number of parts to an edge."""


@dataclass(frozen=True)
class Tessellation:
    """Facets as pieces of a mesh's faces: fixed in the mesh, so that they move and deform with it."""

    face: IntArray
    """(facet,) index of the face that the facet is a piece of."""
    weights: FloatArray
    """(facet, 3, 3) barycentric coordinates in that face of the facet's three corners (corner, vertex)."""
    parts: IntArray
    """(facet,) number of parts that the integral divides each edge into."""
    flat_parts: IntArray | None = None
    """(facet,) those that would do if it were flat; None: `parts`."""
    bent_parts: FloatArray | None = None
    """(facet,) those that the surface's height over it asks for where it is seen straight on, not rounded."""

    def parts_seen(self, poses: Sequence[FloatArray], faces: IntArray, viewpoint: FloatArray) -> IntArray:
        """(facet,) `parts` that will do for what is seen from the viewpoint in each of the `poses`, (vertex, 3) [m]:
        aslant, a surface's height makes less of a difference to the path."""
        if self.flat_parts is None or self.bent_parts is None or not self.bent_parts.any():
            return self.parts
        found = np.ceil(self.bent_parts * _straightness(poses, faces, viewpoint)[self.face])
        return np.maximum(self.flat_parts, found.astype(np.int32))

    @cached_property
    def places(self) -> IntArray:
        """(facet,) where in its face each facet lies, as a number that no other facet of the face has."""
        middle = np.rint(self.weights.mean(axis=1)[:, :2] * 2**15).astype(np.int32)
        return np.asarray(middle[:, 0] * 2**16 + middle[:, 1], dtype=np.int32)

    @cached_property
    def pieces(self) -> NDArray[np.intp]:
        """Facets that are less than their face."""
        return np.flatnonzero((self.weights != np.eye(3)).any(axis=(1, 2)))

    @cached_property
    def _middles(self) -> FloatArray:
        """(facet, 3) barycentric coordinates of the facets' middles."""
        return middles(self.weights)

    def are_the_faces(self, count: int) -> bool:
        """Whether facets and the `count` faces are the same, one by one."""
        return len(self.face) == count and self._begin_the_faces

    @cached_property
    def _begin_the_faces(self) -> bool:
        return not len(self.pieces) and bool((self.face == np.arange(len(self.face))).all())

    def corners(self, vertices: FloatArray, faces: IntArray, chosen: NDArray[np.intp] | None = None) -> FloatArray:
        """(facet, 3, 3) corner positions [m] for the mesh's (vertex, 3) positions; those of the facets that `chosen`
        counts out."""
        if chosen is not None:
            return np.asarray(self.weights[chosen] @ corners_of(vertices, faces[self.face[chosen]]), dtype=np.float64)
        corners = corners_of(vertices, faces if self.are_the_faces(len(faces)) else faces[self.face])
        pieces = self.pieces  # few, where a mesh is fine
        corners[pieces] = self.weights[pieces] @ corners[pieces]
        return np.asarray(corners, dtype=np.float64)

    def bends(
        self,
        vertices: Sequence[FloatArray],
        faces: IntArray,
        smooth: Smoothing | None,
        chosen: NDArray[np.intp] | None = None,
    ) -> list[Bend]:
        """How the facets are bent at several times, for the mesh's (vertex, 3) positions [m] then; others than those
        that `chosen` counts out may be left flat."""
        count, pieces = len(self.face), self.pieces
        if smooth is None or not count:
            return [Bend(np.zeros((count, 3, 3))) for _ in vertices]
        whole = self.are_the_faces(len(faces))
        shown = chosen
        if not whole and chosen is not None:
            there = np.zeros(len(faces), np.bool_)
            there[self.face[chosen]] = True
            shown = np.flatnonzero(there)
        found = smooth.bends(vertices, faces, shown)
        if not whole:
            found = [bend.take(self.face) for bend in found]
        if len(pieces):
            weights = self.weights[pieces]
            for number, bend in enumerate(found):
                own, lifts = bend.take(pieces).within(weights), np.zeros((count, 3, 3))
                bend.rises[pieces], lifts[pieces] = own.rises, own.lifts
                found[number] = Bend(bend.rises, lifts)
        return found

    def centroids(self, vertices: FloatArray, faces: IntArray, chosen: NDArray[np.intp]) -> FloatArray:
        """(chosen, 3) means of the corners [m] of the facets that `chosen` counts out."""
        ends, weights = np.take(faces, self.face[chosen], axis=0), np.take(self._middles, chosen, axis=0)
        shape = len(chosen), len(vertices)
        rows = csr_array((weights.ravel(), ends.ravel(), np.arange(0, 3 * len(chosen) + 1, 3)), shape=shape)
        return np.asarray(rows @ np.asarray(vertices, np.float64))


def _straightness(poses: Sequence[FloatArray], faces: IntArray, viewpoint: FloatArray) -> FloatArray:
    """(face,) root of the cosine of the angle at which each is seen, the largest of all `poses`."""
    dr, types = drjit_types()
    found = dr.empty(types.Float64, len(faces))
    given = {
        "lanes": dr.arange(types.UInt32, len(faces)),
        "faces": upload(types.UInt32, faces),
        "vertices": upload(types.Float64, joined(poses)),
        "points": dr.opaque(types.UInt32, len(poses[0])),
        "poses": dr.opaque(types.UInt32, len(poses)),
        "viewpoint": upload(types.Float64, viewpoint),
        "found": found,
    }
    _STRAIGHTNESS(given)
    return np.asarray(found.numpy())


def _straighten(given: dict[str, Any]) -> None:
    """The kernel of :func:`_straightness`."""
    dr, types = drjit_types()
    Float, UInt32, Array3, lane = types.Float64, types.UInt32, types.Array3f64, given["lanes"]
    ends = [dr.gather(UInt32, given["faces"], 3 * lane + k) for k in range(3)]
    eye = Array3(*(dr.gather(Float, given["viewpoint"], UInt32(axis)) for axis in range(3)))

    def seen(pose: Any, most: Any) -> tuple[Any, Any]:
        first = [3 * (pose * given["points"] + each) for each in ends]
        a, b, c = (Array3(*(dr.gather(Float, given["vertices"], k + axis) for axis in range(3))) for k in first)
        cross = dr.cross(b - a, c - a)
        offset = a - eye
        size = dr.sqrt(dr.squared_norm(cross) * dr.squared_norm(offset))
        return pose + 1, dr.maximum(most, abs(dr.dot(cross, offset)) / dr.maximum(size, 1e-300))

    begun = dr.zeros(UInt32, dr.width(lane)), dr.zeros(Float, dr.width(lane))
    most = dr.while_loop(begun, lambda pose, _: pose < given["poses"], seen)[1]
    dr.scatter(given["found"], dr.sqrt(dr.minimum(most, 1.0)), lane, mode=dr.ReduceMode.Permute)
    dr.eval(given["found"])


_STRAIGHTNESS = Frozen(_straighten)


NOTHING = Tessellation(np.zeros(0, np.int32), np.zeros((0, 3, 3)), np.zeros(0, np.int32))
"""No facets of a surface."""


def phase_bulge(corners: FloatArray, viewpoint: FloatArray, frequency: float) -> FloatArray:
    """(facet,) two-way phase [rad] by which the mean over the corners exceeds that at the centroid.

    It measures the quadratic phase on a facet: about k L^2 / (4 R) for an edge L at range R.
    """
    from_view = corners - viewpoint
    offset = corners - middles(corners)[:, None]
    centre = middles(from_view)[:, None]
    # |x| - |y| = (x - y) . (x + y) / (|x| + |y|), exact where a difference of norms cancels.
    sizes = lengths(from_view) + lengths(centre)
    excess = np.einsum("fci,fci->fc", offset, from_view + centre) / np.maximum(sizes, 1e-12)
    return np.asarray(
        np.abs(4 * np.pi * frequency / SPEED_OF_LIGHT * np.einsum("fc->f", excess) / 3.0), dtype=np.float64
    )


def allowed_bulge(rtol: float) -> float:
    """Largest phase bulge [rad] that keeps the relative error of a surface's return below `rtol`.

    The facet integral keeps the quadratic phase q to first order and its variance. In each grating lobe that a plate of
    facets alike adds up to it misses what else is of second order: for a bulge b (:func:`phase_bulge`) as much as that
    variance, 3 b^2 / 160 on an equilateral triangle, and more on the right triangles that bisection makes. Plates a
    hundred wavelengths wide err by up to 0.1 b^2, hence b = sqrt(10 rtol).
    """
    return float(min(np.sqrt(10.0 * rtol), MAX_BULGE))


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(lengths(vectors), 1e-12)[..., None])


@dataclass(frozen=True)
class _Patches:
    """Pieces of a smooth surface."""

    height: FloatArray
    """(facet,) how high it is over each [m]."""
    weights: FloatArray
    """(facet, 3, 3) of each in its face."""
    rises: FloatArray | None
    """(facet, 3, 3) of its face [m]; None leaves out where it turns out of sight."""

    def ends(self, chosen: NDArray[np.bool_], corners: FloatArray, viewpoint: FloatArray) -> NDArray[np.bool_]:
        """Whether the `chosen` ones, with flat `corners` (chosen, 3, 3) [m], turn out of sight of the viewpoint."""
        if self.rises is None:
            return np.zeros(int(np.count_nonzero(chosen)), np.bool_)
        bend = Bend(self.rises[chosen]).within(self.weights[chosen])
        places = corners - viewpoint if bend.lifts is None else corners - viewpoint + bend.lifts
        first, second = places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]
        r = 4.0 * bend.rises
        # At each corner: the tangents along its two edges.
        tangents = (
            (first + r[:, 2], second + r[:, 1]),
            (first - r[:, 2], second + r[:, 0] - r[:, 2]),
            (first + r[:, 0] - r[:, 1], second - r[:, 1]),
        )
        found = np.stack(
            [
                np.einsum("fi,fi->f", np.cross(one, other), places[:, corner])
                for corner, (one, other) in enumerate(tangents)
            ]
        )
        return np.asarray((np.min(found, axis=0) < 0) & (np.max(found, axis=0) > 0))


def _untold(ends: FloatArray, middle: FloatArray) -> FloatArray:
    """(facet,) by how much gains at the corners, `ends` (facet, 3), differ in the mean from what follows from that in
    the `middle` (facet,) and the rise there: the integral lets gains change by the same share per metre all over."""
    return np.asarray(np.abs(np.exp(np.log(np.maximum(ends, _NONE)).mean(axis=1)) - middle))


def outgrown(
    corners: FloatArray,
    viewpoint: FloatArray,
    frequency: float,
    rtol: float,
    importance: Callable[[FloatArray], FloatArray],
) -> bool:
    """Whether flat facets with these `corners` (facet, 3, 3) [m] have moved to where the antennas' gain asks for such
    of a third of the area, which is no matter of distance; the others are arguments of :func:`tessellate`."""
    left = _untold(importance(_unit(corners - viewpoint)), importance(_unit(middles(corners) - viewpoint)))
    steep = np.flatnonzero(left > 3.0 * PATTERN * max(rtol, _FINEST))
    return bool((phase_bulge(corners[steep], viewpoint, frequency) > _LEAST_BULGE).any())


def _demand(
    corners: FloatArray,
    viewpoint: FloatArray,
    frequency: float,
    rtol: float,
    importance: Callable[[FloatArray], FloatArray] | None,
    half_band: float,
    bend: _Patches | None = None,
    still: bool = False,
) -> tuple[NDArray[np.bool_], IntArray, FloatArray]:
    """(facet,) whether each is too large, the number of parts that its edges are to be divided into if it is flat, and
    the number, not rounded, for how high the surface is over it.

    `bend` is how they bend, where they are of a smooth surface, and `still` is that it stays.
    """
    allowed = np.full(len(corners), allowed_bulge(rtol))
    bulge = phase_bulge(corners, viewpoint, frequency)
    coarse = np.zeros(len(corners), np.bool_)
    if importance is not None:
        # A facet counts as much as its most important corner: large ones reach into the beam.
        ends, middle = importance(_unit(corners - viewpoint)), importance(_unit(middles(corners) - viewpoint))
        weight = np.maximum(widest(ends), middle)
        if bend is None or still:
            most = (STILL_PATTERN if still else PATTERN) * max(rtol, _FINEST)
            coarse |= (_untold(ends, middle) > most) & (bulge > _LEAST_BULGE)
        # There are more of them out of the beam than in it, and their errors add up: the root of what they could do.
        allowed = np.minimum(np.sqrt(10.0 * rtol / np.sqrt(np.maximum(weight, 1e-12))), MAX_BULGE)
    coarse |= bulge > np.clip(STILL_BULGE if still else FACET_BULGE, allowed, MAX_PARTS**2 * allowed)
    if half_band > 0:
        away = lengths(corners - viewpoint)
        depth = widest(away) + widest(-away)  # half the spread of the paths
        coarse |= 2 * np.pi * half_band / SPEED_OF_LIGHT * depth > BAND_SWING
    height = np.zeros(len(corners))
    if bend is not None:
        height = 4 * np.pi * frequency / SPEED_OF_LIGHT * bend.height / CURVED
        coarse |= np.maximum(bulge, height) > MAX_PARTS**2 * allowed
        # The path length over a curved facet is taken for quadratic; u v^2 / R^2 and h u / R are what comes next.
        size = widest(lengths(corners[:, [1, 2, 0]] - corners))
        share = size / np.maximum(lengths(middles(corners) - viewpoint), 1e-3)
        cubic = 2 * np.pi * frequency / SPEED_OF_LIGHT * share * (CUBIC * size * share + BOWED * bend.height)
        coarse |= cubic > 0.1 * allowed
        turns = 6.0 * bend.height > TURN * allowed * size  # a circle's arc turns by 8 sagittas over its chord
        coarse[turns] |= bend.ends(turns, corners[turns], viewpoint)
    return coarse, np.maximum(np.ceil(np.sqrt(bulge / allowed)), 1.0).astype(np.int32), np.sqrt(height / allowed)


def tessellate(
    vertices: FloatArray,
    faces: IntArray,
    viewpoint: FloatArray,
    frequency: float,
    rtol: float,
    importance: Callable[[FloatArray], FloatArray] | None = None,
    max_range: float = np.inf,
    half_band: float = 0.0,
    limit: int = 5_000_000,
    images: Sequence[tuple[FloatArray, float]] = (),
    smooth: Smoothing | None = None,
    still: bool = False,
) -> Tessellation:
    """Bisect the longest edges until every facet is small enough to be integrated in few parts.

    A facet is what is seen or hidden and what moves as one; how finely it is integrated is the parts' business: each
    of them is allowed its quadratic phase at `rtol`.

    Parameters
    ----------
    vertices, faces
        (vertex, 3) [m] and (face, 3).
    viewpoint
        (3,) phase centre of the radar [m].
    frequency
        Highest frequency of the band [Hz].
    rtol
        Allowed error relative to what the surface would return in the most important direction.
    importance
        Unit vectors (facet, 3) from the viewpoint to the weight in 0 … 1 that the radar gives to what comes from there:
        where it hardly listens, coarser facets will do, where that changes steeply finer ones. None is 1 all around.
    max_range
        Facets that lie beyond it as a whole are left out [m]: of a town only what is near is split.
    half_band
        Half the band that is sampled [Hz]; facets deeper than :data:`BAND_SWING` allows are split.
    limit
        Largest number of facets.
    images
        Mirror images of the vertices (vertex, 3) [m], which are seen as well, and the `rtol` of each.
    smooth
        Normals of the smooth surface that the mesh samples; None where it is flat.
    still
        Whether it stays where it is.

    Raises
    ------
    ValueError
        If the tolerance would take more than `limit` facets.
    """
    face = np.arange(len(faces), dtype=np.int32)
    height, rises = np.zeros(len(faces)), None
    if smooth is not None:
        # In the middle of a face 4/9 of what its edges rise.
        rises = smooth.bend(vertices, faces).rises
        height = lengths(rises).sum(axis=1) * (4 / 9)
    weights = np.broadcast_to(np.eye(3), (len(faces), 3, 3))
    done_face: list[IntArray] = []
    done_weights: list[FloatArray] = []
    done_parts: list[IntArray] = []
    done_heights: list[FloatArray] = []
    count = 0
    for _ in range(_MAX_SPLITS):
        corners = np.asarray(weights @ vertices[faces[face]], dtype=np.float64)
        if np.isfinite(max_range):
            centre = middles(corners)
            radius = widest(lengths(corners - centre[:, None]))
            near = lengths(centre - viewpoint) - radius < max_range
            face, weights, corners = face[near], weights[near], corners[near]
        # It goes with the square of a piece's edges, as its area does.
        bend = None
        if rises is not None:
            bend = _Patches(height[face] * np.abs(np.linalg.det(weights)), weights, rises[face])
        coarse, parts, high = _demand(corners, viewpoint, frequency, rtol, importance, half_band, bend, still)
        for mirrored, tolerance in images:
            seen = np.asarray(weights @ mirrored[faces[face]], dtype=np.float64)
            shown = None if bend is None else replace(bend, rises=None)
            more = _demand(seen, viewpoint, frequency, tolerance, importance, half_band, shown, still)
            coarse, parts, high = coarse | more[0], np.maximum(parts, more[1]), np.maximum(high, more[2])
        done_face.append(face[~coarse])
        done_weights.append(weights[~coarse])
        done_parts.append(parts[~coarse])
        done_heights.append(high[~coarse])
        count += int(np.count_nonzero(~coarse))
        face, weights, corners = face[coarse], weights[coarse], corners[coarse]
        if len(face) == 0:
            break
        if count + 2 * len(face) > limit:
            raise ValueError(
                f"rtol is {rtol:g}: it takes more than {limit:,} facets in this scene; raise rtol or remove large, "
                "near surfaces that the radar does not need to see"
            )
        edge = lengths(corners[:, [1, 2, 0]] - corners[:, [2, 0, 1]]).argmax(axis=1)  # opposite corner
        row = np.arange(len(face))
        apex, left, right = weights[row, edge], weights[row, (edge + 1) % 3], weights[row, (edge + 2) % 3]
        middle = 0.5 * (left + right)
        face = np.concatenate([face, face])
        weights = np.concatenate([np.stack([apex, left, middle], axis=1), np.stack([apex, middle, right], axis=1)])
    else:
        done_face.append(face)
        done_weights.append(weights)
        done_parts.append(np.full(len(face), MAX_PARTS, dtype=np.int32))
        done_heights.append(np.zeros(len(face)))
    order = np.argsort(np.concatenate(done_face), kind="stable")
    flat, high = np.concatenate(done_parts)[order], np.concatenate(done_heights)[order]
    return Tessellation(
        np.concatenate(done_face)[order],
        np.concatenate(done_weights)[order],
        np.maximum(flat, np.ceil(high).astype(np.int32)),
        flat,
        high,
    )
