"""Splitting faces into facets that are as fine as :mod:`rfgen_sionna.tracing.surface.resolution` asks for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.kernels import FrozenKernel, concatenate_aligned, drjit_types, upload
from rfgen_sionna.scene.mesh import face_corners, lengths, max_component, triangle_centroids
from rfgen_sionna.tracing.surface.quadratic_patch import QuadraticPatch
from rfgen_sionna.tracing.surface.resolution import MAX_PARTS, SmoothPieces, required_splits
from rfgen_sionna.tracing.surface.smoothing import Smoothing

_EQUAL = 1e-9
"""Edges whose lengths differ by less, relative to them, are as long as each other: which is halved is not rounding's to
tell."""
_MAX_SPLITS = 64


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
    curved_parts: FloatArray | None = None
    """(facet,) those that the surface's height over it asks for where it is seen straight on, not rounded."""
    grains: FloatArray | None = None
    """(facet, 3, 3) corners, likewise, of the grain that each facet is of: what scatters as one, however finely it is
    integrated. None: each facet by itself."""

    def visible_parts(self, poses: Sequence[FloatArray], faces: IntArray, viewpoint: FloatArray) -> IntArray:
        """(facet,) `parts` that will do for what is seen from the viewpoint in each of the `poses`, (vertex, 3) [m]:
        aslant, a surface's height makes less of a difference to the path."""
        if self.flat_parts is None or self.curved_parts is None or not self.curved_parts.any():
            return self.parts
        found = np.ceil(self.curved_parts * _straightness(poses, faces, viewpoint)[self.face])
        return np.maximum(self.flat_parts, found.astype(np.int32))

    @cached_property
    def places(self) -> IntArray:
        """(facet,) where in its face each facet's grain lies, as a number that no other grain of the face has."""
        own = self.weights if self.grains is None else self.grains
        middle = np.rint(own.mean(axis=1)[:, :2] * 2**15).astype(np.int32)
        return np.asarray(middle[:, 0] * 2**16 + middle[:, 1], dtype=np.int32)

    @cached_property
    def shares(self) -> FloatArray | None:
        """(facet, 4) which share of its grain each facet is, and the grain's middle in barycentric coordinates of the
        facet; None where each facet is a grain."""
        if self.grains is None:
            return None
        share = np.abs(np.linalg.det(self.weights) / np.linalg.det(self.grains))
        middle = np.linalg.solve(self.weights.transpose(0, 2, 1), self.grains.mean(axis=1)[..., None])[..., 0]
        return np.column_stack([share, middle])

    @cached_property
    def pieces(self) -> NDArray[np.intp]:
        """Facets that are less than their face."""
        return np.flatnonzero((self.weights != np.eye(3)).any(axis=(1, 2)))

    @cached_property
    def _middles(self) -> FloatArray:
        """(facet, 3) barycentric coordinates of the facets' middles."""
        return triangle_centroids(self.weights)

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
            return np.asarray(self.weights[chosen] @ face_corners(vertices, faces[self.face[chosen]]), dtype=np.float64)
        corners = face_corners(vertices, faces if self.are_the_faces(len(faces)) else faces[self.face])
        pieces = self.pieces  # few, where a mesh is fine
        corners[pieces] = self.weights[pieces] @ corners[pieces]
        return np.asarray(corners, dtype=np.float64)

    def patches(
        self,
        vertices: Sequence[FloatArray],
        faces: IntArray,
        smooth: Smoothing | None,
        chosen: NDArray[np.intp] | None = None,
    ) -> list[QuadraticPatch]:
        """How the facets are bent at several times, for the mesh's (vertex, 3) positions [m] then; others than those
        that `chosen` counts out may be left flat."""
        count, pieces = len(self.face), self.pieces
        if smooth is None or not count:
            return [QuadraticPatch(np.zeros((count, 3, 3))) for _ in vertices]
        whole = self.are_the_faces(len(faces))
        any_visible = chosen
        if not whole and chosen is not None:
            there = np.zeros(len(faces), np.bool_)
            there[self.face[chosen]] = True
            any_visible = np.flatnonzero(there)
        found = smooth.patches(vertices, faces, any_visible)
        if not whole:
            found = [patch.take(self.face) for patch in found]
        if len(pieces):
            weights = self.weights[pieces]
            for number, patch in enumerate(found):
                own, corner_offsets = patch.take(pieces).within(weights), np.zeros((count, 3, 3))
                patch.sagittas[pieces], corner_offsets[pieces] = own.sagittas, own.corner_offsets
                found[number] = QuadraticPatch(patch.sagittas, corner_offsets)
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
        "vertices": upload(types.Float64, concatenate_aligned(poses)),
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

    def visible(pose: Any, most: Any) -> tuple[Any, Any]:
        first = [3 * (pose * given["points"] + each) for each in ends]
        a, b, c = (Array3(*(dr.gather(Float, given["vertices"], k + axis) for axis in range(3))) for k in first)
        cross = dr.cross(b - a, c - a)
        offset = a - eye
        size = dr.sqrt(dr.squared_norm(cross) * dr.squared_norm(offset))
        return pose + 1, dr.maximum(most, abs(dr.dot(cross, offset)) / dr.maximum(size, 1e-300))

    begun = dr.zeros(UInt32, dr.width(lane)), dr.zeros(Float, dr.width(lane))
    most = dr.while_loop(begun, lambda pose, _: pose < given["poses"], visible)[1]
    dr.scatter(given["found"], dr.sqrt(dr.minimum(most, 1.0)), lane, mode=dr.ReduceMode.Permute)
    dr.eval(given["found"])


_STRAIGHTNESS = FrozenKernel(_straighten)


NO_FACETS = Tessellation(np.zeros(0, np.int32), np.zeros((0, 3, 3)), np.zeros(0, np.int32))
"""No facets of a surface."""


def tessellate(
    vertices: FloatArray,
    faces: IntArray,
    viewpoint: FloatArray,
    frequency: float,
    rtol: float,
    pattern_gain: Callable[[FloatArray], FloatArray] | None = None,
    max_range: float = np.inf,
    half_band: float = 0.0,
    limit: int = 5_000_000,
    images: Sequence[tuple[FloatArray, float]] = (),
    smooth: Smoothing | None = None,
    still: bool = False,
    grain: float | None = None,
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
    grain
        Longest edge of grains [m]: facets are no larger, and know theirs, which are the same from wherever the surface
        is seen as long as it keeps its shape. None: there are none.

    Raises
    ------
    ValueError
        If the tolerance would take more than `limit` facets.
    """
    face = np.arange(len(faces), dtype=np.int32)
    height, sagittas = np.zeros(len(faces)), None
    if smooth is not None:
        # In the middle of a face 4/9 of what its edges rise.
        sagittas = smooth.patch(vertices, faces).sagittas
        height = lengths(sagittas).sum(axis=1) * (4 / 9)
    weights = np.broadcast_to(np.eye(3), (len(faces), 3, 3))
    grains = np.full(weights.shape, np.nan)
    done_grains: list[FloatArray] = []
    done_face: list[IntArray] = []
    done_weights: list[FloatArray] = []
    done_parts: list[IntArray] = []
    done_heights: list[FloatArray] = []
    count = 0
    for times in range(_MAX_SPLITS):
        corners = np.asarray(weights @ vertices[faces[face]], dtype=np.float64)
        if np.isfinite(max_range):
            centre = triangle_centroids(corners)
            radius = max_component(lengths(corners - centre[:, None]))
            near = lengths(centre - viewpoint) - radius < max_range
            if not near.all():
                face, weights, grains, corners = face[near], weights[near], grains[near], corners[near]
        # It goes with the square of a piece's edges, as its area does.
        patch = None
        if sagittas is not None:
            patch = SmoothPieces(height[face] * 0.5**times, weights, sagittas[face])
        coarse, parts, high = required_splits(
            corners, viewpoint, frequency, rtol, pattern_gain, half_band, patch, still
        )
        for mirrored, tolerance in images:
            visible = np.asarray(weights @ mirrored[faces[face]], dtype=np.float64)
            any_visible = None if patch is None else replace(patch, sagittas=None)
            more = required_splits(
                visible, viewpoint, frequency, tolerance, pattern_gain, half_band, any_visible, still
            )
            coarse, parts, high = coarse | more[0], np.maximum(parts, more[1]), np.maximum(high, more[2])
        sides = lengths(corners[:, [1, 2, 0]] - corners[:, [2, 0, 1]])  # opposite corner
        # Of edges alike one, and those as long as a grain, whatever rounding says: the same from any side.
        if grain is not None:
            fresh = np.isnan(grains[:, 0, 0]) & (max_component(sides) <= (1.0 + _EQUAL) * grain)
            grains[fresh] = weights[fresh]
            coarse |= np.isnan(grains[:, 0, 0])
        done_face.append(face[~coarse])
        done_weights.append(weights[~coarse])
        done_grains.append(grains[~coarse])
        done_parts.append(parts[~coarse])
        done_heights.append(high[~coarse])
        count += int(np.count_nonzero(~coarse))
        face, weights, grains, sides = face[coarse], weights[coarse], grains[coarse], sides[coarse]
        if len(face) == 0:
            break
        if count + 2 * len(face) > limit:
            raise ValueError(
                f"rtol is {rtol:g}: it takes more than {limit:,} facets in this scene; raise rtol or remove large, "
                "near surfaces that the radar does not need to see"
            )
        longest = sides >= (1.0 - _EQUAL) * max_component(sides)[:, None]
        edge = longest.argmax(axis=1) if grain is not None else 2 - longest[:, ::-1].argmax(axis=1)
        row = np.arange(len(face))
        apex, left, right = weights[row, edge], weights[row, (edge + 1) % 3], weights[row, (edge + 2) % 3]
        middle = 0.5 * (left + right)
        face, grains = np.concatenate([face, face]), np.concatenate([grains, grains])
        weights = np.concatenate([np.stack([apex, left, middle], axis=1), np.stack([apex, middle, right], axis=1)])
    else:
        done_face.append(face)
        done_weights.append(weights)
        done_grains.append(np.where(np.isnan(grains), weights, grains))
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
        None if grain is None else np.concatenate(done_grains)[order],
    )
