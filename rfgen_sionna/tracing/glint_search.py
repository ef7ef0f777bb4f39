"""Where glints are: over each piece of a face it is known at the corners how far the ray that leaves there misses the
radar after its second reflection; where zero lies among the three, Newton's method finds the place.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from rfgen_sionna.records import FloatArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.glint_pieces import Pieces
from rfgen_sionna.tracing.glints import Glints, unit_normals
from rfgen_sionna.tracing.smooth import QUARTERS
from rfgen_sionna.tracing.tubes.media import mirrored
from rfgen_sionna.tracing.tubes.passage import tangents
from rfgen_sionna.tracing.tubes.skin import Skin, tangential

FINER, AT_RIMS = 1, 6
"""How often pieces that may hold a glint are divided further, and such of which not all corners' rays land."""
WIDE = 0.5
"""Pieces whose misses differ by more than this [rad] are divided, too: over them misses are not linear."""
FAR = 3.0
"""Pieces hold none where the least miss at a corner is more than this times what misses differ by ..."""
SWAY = 2.0
"""... which is this times what normals turn by, and as much again for how the surface bends where rays land, so that
twice the turn times the way there counts; where rays land nowhere, pieces are divided until other things are wider."""
GAP = 1e-4
"""Rays leave a surface this far above it [m]."""
STEPS = 6
"""Of Newton's method."""
_STEP = 1e-3
"""Of the barycentric coordinates, for differences."""
EXACT = 1e-3
"""By how much a ray may miss [rad]: places are made exact on the surfaces' quadrics."""
ENOUGH = 1e-6
"""Miss at which Newton's method ends [rad]."""
SHORTEST = 2.0
"""Wavelengths that both places are apart at least: in a crease of a body rays mean nothing."""
BESIDE = 0.1
"""How far beyond its piece a place may lie, in barycentric coordinates; the next piece has it as well."""
_QUARTERS = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2], [5, 4, 3]])
"""Corners of the four parts of a piece: its own, then the middles of its edges 01, 02 and 12."""
SAME = 1e-3
"""Glints whose places are as near to each other as that are one [m]."""


@dataclass(frozen=True)
class Things:
    """Bent surfaces in balls around them."""

    centre: FloatArray
    """(thing, 3) [m]"""
    radius: FloatArray
    """(thing,) [m]"""
    thick: FloatArray
    """(thing,) how thick limbs and the like are, or the whole [m]."""
    first: NDArray[np.int64]
    """(thing,) face of the ray scene ..."""
    last: NDArray[np.int64]
    """... up to which it has them."""


@dataclass(frozen=True)
class _Landing:
    """Where rays by way of places on faces land, and where they go from there."""

    facet: NDArray[np.int64]
    """(ray,) -1 for nowhere, or where it doesn't count."""
    weights: FloatArray
    point: FloatArray
    normal: FloatArray
    on: FloatArray
    """(ray, 3) unit vector in which it goes on."""
    home: FloatArray
    """(ray, 3) unit vector towards the source."""
    start: FloatArray
    """(ray, 3) place that it leaves [m]."""
    out: FloatArray
    """(ray, 3) unit vector in which it leaves that."""
    lever: FloatArray
    """(ray,) by how much more than what it left the surface that it lands on turns it, for how far that is."""

    @property
    def comes(self) -> NDArray[np.bool_]:
        """(ray,) whether it comes back by less than a right angle off."""
        return np.asarray((self.facet >= 0) & (np.einsum("ri,ri->r", self.on, self.home) > 0))


class Search:
    """Looks for glints at an instant.

    Parameters
    ----------
    skin, rays
        The surfaces as they stand.
    source
        (3,) phase centre of the radar [m].
    wanted
        (face,) which faces of the ray scene count.
    max_range
        Half the length of the longest way that counts [m].
    wavelength
        [m]
    bent
        (face,) about how much each face's normal turns per length [1/m].
    things
        What rays that land nowhere may have missed.
    tells
        (face,) of which there has to be one on a glint's way.
    bends
        Faces (n,) to how normals turn at their corners (n, 3, 3, 3) [1/m].
    """

    def __init__(
        self,
        skin: Skin,
        rays: RayScene,
        source: FloatArray,
        wanted: NDArray[np.bool_],
        max_range: float,
        wavelength: float,
        bent: FloatArray,
        things: Things,
        tells: NDArray[np.bool_],
        bends: Callable[[NDArray[np.int64]], FloatArray],
    ) -> None:
        self._skin, self._rays, self._source, self._wanted = skin, rays, source, wanted
        self._curvature, self._things, self._tells, self._bends = bent, things, tells, bends
        self._longest, self._shortest = 2.0 * max_range, SHORTEST * wavelength
        self.sent = 0
        """Rays sent so far."""

    def find(self, pieces: Pieces) -> Glints:
        """All glints whose rays first meet one of the `pieces`, or come back from one."""
        index = np.flatnonzero(self._wanted[pieces.facet])
        index = index[self._tells[pieces.facet[index]] | self._reach(pieces, index)]
        used, node = np.unique(pieces.node[index], return_inverse=True)
        piece, corner = np.divmod(pieces.at[used], 3)
        landed = self._land(pieces.facet[piece], pieces.corners[piece, corner], exact=False)
        node = node.reshape(-1, 3)
        facet, corners, bent = pieces.facet[index], pieces.corners[index], pieces.turn[index]
        guesses: list[tuple[NDArray[np.int64], FloatArray, FloatArray]] = []
        for turn in range(AT_RIMS + 1):
            whole = landed.comes[node].all(axis=1)
            if turn >= FINER:
                lane = np.flatnonzero(whole)
                guesses.append(_guessed(landed, node[lane], facet[lane], corners[lane]))
            held = _may_hold(landed, node, bent) | self._around(landed, node, facet, bent)
            rest = np.flatnonzero(held & (~whole | (turn < FINER) | (_spread(landed, node) > WIDE)))
            if len(rest) == 0 or turn == AT_RIMS:
                break
            # Of four pieces three corners are those of the whole; the middles of its edges are new.
            middles = 0.5 * (corners[rest][:, [0, 0, 1]] + corners[rest][:, [1, 2, 2]])
            fresh = len(landed.facet) + np.arange(3 * len(rest)).reshape(-1, 3)
            new = self._land(np.repeat(facet[rest], 3), middles.reshape(-1, 3), exact=False)
            landed = _Landing(*(np.concatenate([getattr(each, f.name) for each in (landed, new)]) for f in fields(new)))
            every = np.concatenate([node[rest], fresh], axis=1)
            node = every[:, _QUARTERS].reshape(-1, 3)
            facet, bent = np.repeat(facet[rest], 4), np.repeat(0.5 * bent[rest], 4)
            corners = np.einsum("qcv,pvw->pqcw", QUARTERS, corners[rest]).reshape(-1, 3, 3)
        if not guesses:
            return Glints.none()
        face, place, axes = (np.concatenate([each[part] for each in guesses]) for part in range(3))
        place, miss = self._solve(face, place, axes)
        lane = np.flatnonzero((miss < EXACT) & (place > -BESIDE).all(axis=1))
        return self._seen(face[lane], place[lane])

    def _reach(self, pieces: Pieces, index: NDArray[np.intp]) -> NDArray[np.bool_]:
        """(piece,) of the pieces `index` of surfaces that need others to count, which may send rays to those."""
        found, things = np.zeros(len(index), np.bool_), self._things
        lane = np.flatnonzero(~self._tells[pieces.facet[index]])
        facet, weights = np.repeat(pieces.facet[index[lane]], 3), pieces.corners[index[lane]].reshape(-1, 3)
        start, _, out, _ = self._set_out(facet, weights)
        start, out = start.reshape(-1, 3, 3), out.reshape(-1, 3, 3)
        for number in np.flatnonzero(self._tells[things.first]).tolist():
            held = _beside(start, out, pieces.turn[index[lane]], things.centre[number], things.radius[number])
            found[lane] |= held[0]
        return found

    def _around(
        self, landed: _Landing, node: NDArray[np.intp], facet: NDArray[np.int64], turn: FloatArray
    ) -> NDArray[np.bool_]:
        """(piece,) which pieces none of whose corners' rays land, may have another thing between these rays."""
        found = np.zeros(len(node), np.bool_)
        lane = np.flatnonzero((landed.facet[node] < 0).all(axis=1))
        start, out = landed.start[node[lane]], landed.out[node[lane]]
        things = self._things
        for number in range(len(things.radius)):
            held, wide = _beside(start, out, turn[lane], things.centre[number], things.radius[number])
            own = (facet[lane] >= things.first[number]) & (facet[lane] < things.last[number])
            found[lane] |= held & ~own & (wide > 0.25 * things.thick[number])
        return found

    def _land(self, facet: NDArray[np.int64], weights: FloatArray, exact: bool = True) -> _Landing:
        """Of rays from the source by way of places on faces `facet` (ray,) at `weights` (ray, 3); not `exact`, where
        the mesh is met, not the smooth surface."""
        skin, count = self._skin, len(facet)
        point, normal, out, span = self._set_out(facet, weights)
        rise = GAP + 2.0 * np.abs(skin.rises[facet]).max(axis=(1, 2), initial=0.0)
        place, there, across, on, home = (np.zeros((count, 3)) for _ in range(5))
        found = _Landing(np.full(count, -1, np.int64), place, there, across, on, home, point, out, np.zeros(count))
        if count == 0:
            return found
        hit = self._rays.first_hit(point + rise[:, None] * normal, out)
        self.sent += count
        face = np.maximum(hit.facet, 0)
        counts = self._wanted[face] & (self._tells[face] | self._tells[facet])
        lane = np.flatnonzero((hit.facet >= 0) & (hit.facet != facet) & counts)
        face, place = hit.facet[lane].astype(np.int64), hit.barycentric[lane]
        found.facet[lane] = face
        if exact:
            met = skin.meet(point[lane], out[lane], face, place)
            found.weights[lane], there, across = met.weights, met.point, met.normal
        else:
            there = point[lane] + (hit.distance[lane] + rise[lane])[:, None] * out[lane]
            across = unit_normals(skin, face, place)
        home = self._source - there
        beyond = lengths(span[lane]) + hit.distance[lane] + lengths(home) > self._longest
        found.facet[lane[beyond]] = -1
        found.lever[lane] = 2.0 * hit.distance[lane] * self._curvature[face]
        found.point[lane], found.normal[lane] = there, across
        found.on[lane] = mirrored(out[lane], across)
        found.home[lane] = home / np.maximum(lengths(home), 1e-12)[:, None]
        return found

    def _set_out(
        self, facet: NDArray[np.int64], weights: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """(ray, 3) places on faces `facet` (ray,) at `weights` (ray, 3) [m], normals towards the source, unit vectors
        in which rays from there go on, and the way from there [m]."""
        _, point = self._skin.places(facet, weights)
        span = point - self._source
        ray = span / np.maximum(lengths(span), 1e-12)[:, None]
        normal = unit_normals(self._skin, facet, weights)
        normal *= -np.sign(np.einsum("ri,ri->r", normal, ray))[:, None]
        return point, normal, mirrored(ray, normal), span

    def _solve(self, facet: NDArray[np.int64], place: FloatArray, axes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(piece, 3) places on faces from where rays come back to the source, and by how much they miss it (piece,)
        [rad]: infinitely where they land nowhere."""
        best, place = np.full(len(facet), np.inf), place.copy()
        found, count = place.copy(), len(facet)
        ways = _STEP * np.array([[0, 0, 0], [-1, 1, 0], [-1, 0, 1]])
        lane = np.arange(count)
        for _ in range(STEPS):
            if len(lane) == 0:
                break
            tried = (place[lane, None] + ways).reshape(-1, 3)
            landed = self._land(np.repeat(facet[lane], 3), tried)
            away = (landed.on - landed.home).reshape(-1, 3, 3)
            miss = np.einsum("pci,pia->pca", away, axes[lane])
            there = (landed.facet >= 0).reshape(-1, 3).all(axis=1)
            left = np.where(there, lengths(away[:, 0]), np.inf)
            better = left < best[lane]
            best[lane[better]], found[lane[better]] = left[better], place[lane[better]]
            slope = (miss[:, 1:] - miss[:, :1]).transpose(0, 2, 1) / _STEP
            determinant = np.linalg.det(slope)
            usable = there & (np.abs(determinant) > 1e-12)
            slope[~usable] = np.eye(2)
            step = np.where(usable[:, None], -np.linalg.solve(slope, miss[:, 0][..., None])[..., 0], 0.0)
            step *= np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(axis=1), 1e-30))[:, None]
            place[lane] += np.column_stack([-step.sum(axis=1), step])
            lane = lane[there & (left > ENOUGH)]
        return found, best

    def _seen(self, facet: NDArray[np.int64], place: FloatArray) -> Glints:
        """Of the places on faces those that the source sees, with where their rays land, if it sees that."""
        skin = self._skin
        landed = self._land(facet, place)
        flat, point = skin.places(facet, place)
        there, _ = skin.places(np.maximum(landed.facet, 0), landed.weights)
        lane = np.flatnonzero(landed.facet >= 0)
        free = ~self._rays.occluded(self._source, flat[lane], facet[lane]) if len(lane) else np.zeros(0, np.bool_)
        lane = lane[free]
        if len(lane):
            lane = lane[~self._rays.occluded(self._source, there[lane], landed.facet[lane])]
        self.sent += 2 * len(facet)
        span = point[lane] - self._source
        met = skin.meet(np.broadcast_to(self._source, span.shape), span / lengths(span)[:, None],
                        facet[lane], place[lane])  # fmt: skip
        one = facet[lane], place[lane], met.point, met.normal
        other = [each[lane] for each in (landed.facet, landed.weights, landed.point, landed.normal)]
        faces, places, points, normals = (np.stack(pair, axis=1) for pair in zip(one, other, strict=True))
        turned = np.flatnonzero(faces[:, 0] > faces[:, 1])
        for each in (faces, places, points, normals):
            each[turned] = each[turned][:, ::-1]
        far = np.flatnonzero(lengths(points[:, 1] - points[:, 0]) >= self._shortest)
        kept = far[_apart(points[far])]
        return self._bent(faces[kept], places[kept], points[kept], normals[kept])

    def _bent(self, facet: NDArray[np.int64], place: FloatArray, point: FloatArray, normal: FloatArray) -> Glints:
        """Glints (glint, 2), ... with how their surfaces bend."""
        face, across = facet.reshape(-1), normal.reshape(-1, 3)
        own = self._bends(face)
        outward = np.einsum("ni,ni->n", unit_normals(self._skin, face, place.reshape(-1, 3)), across)
        own = own * np.sign(outward)[:, None, None, None]  # positive where they bulge towards the ray
        bend = tangential(np.einsum("nc,ncij->nij", place.reshape(-1, 3), own), across)
        twist = _twists(self._skin.corners[face], own)
        return Glints(facet, place, point, normal, bend.reshape(-1, 2, 3, 3), twist.reshape(-1, 2, 3, 3, 3))


def _beside(
    start: FloatArray, out: FloatArray, turn: FloatArray, centre: FloatArray, radius: float
) -> tuple[NDArray[np.bool_], FloatArray]:
    """(piece,) whether rays between those from `start` (piece, 3, 3) along `out`, of pieces whose normals turn by
    `turn` (piece,), may come into a ball, and how far the rays are apart there (piece,) [m]."""
    middle, axis = start.mean(axis=1), out.mean(axis=1)
    axis /= np.maximum(lengths(axis), 1e-9)[:, None]
    width = np.sqrt(((start - middle[:, None]) ** 2).sum(axis=2)).max(axis=1, initial=0.0)
    offset = centre - middle
    along = np.einsum("pi,pi->p", offset, axis)
    across = np.sqrt(np.maximum((offset**2).sum(axis=1) - along**2, 0.0))
    wide = width + 2.0 * turn * np.maximum(along, 0.0)
    return (along > -radius) & (across < radius + wide), wide


def _apart(points: FloatArray) -> NDArray[np.intp]:
    """Which of the pairs of `points` (glint, 2, 3) [m] to keep, each once: neighbouring pieces find the same ones, and
    those that go the other way round."""
    kept = np.ones(len(points), np.bool_)
    if len(points) > 1:
        pairs = np.sort(cKDTree(points.reshape(-1, 6)).query_pairs(SAME, output_type="ndarray"), axis=1)
        for first, second in pairs[np.lexsort(pairs.T[::-1])].tolist():
            if kept[first]:
                kept[second] = False
    return np.flatnonzero(kept)


def _guessed(
    landed: _Landing, node: NDArray[np.intp], facet: NDArray[np.int64], corners: FloatArray
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Of pieces with corners `node` (piece, 3), all of which come back, those over which misses go through zero: their
    faces, where on them that is (piece, 3), and the axes (piece, 3, 2) across the way back."""
    axes = tangents(landed.home[node[:, 0]])
    miss = np.einsum("pci,pia->pca", (landed.on - landed.home)[node], axes)
    share = _barycentre(miss)
    lane = np.flatnonzero((share > -BESIDE).all(axis=1))
    return facet[lane], np.einsum("pc,pcv->pv", share[lane], corners[lane]), axes[lane]


def _may_hold(landed: _Landing, node: NDArray[np.intp], turn: FloatArray) -> NDArray[np.bool_]:
    """(piece,) which pieces with corners `node` (piece, 3) may hold a glint: misses differ by about as much as the
    least of them. Where not all corners' rays come back that is told by the `turn` (piece,) of the normals."""
    there = (landed.facet >= 0)[node]
    away = np.where(there[..., None], (landed.on - landed.home)[node], np.nan)
    least = np.fmin.reduce(np.sqrt((away**2).sum(axis=2)), axis=1)
    sway = SWAY * turn * (1.0 + landed.lever[node].max(axis=1))
    change = np.where(landed.comes[node].all(axis=1), FAR * _spread(landed, node), sway)
    return np.asarray(there.any(axis=1) & (least < change))


def _spread(landed: _Landing, node: NDArray[np.intp]) -> FloatArray:
    """(piece,) by how much misses at the corners `node` (piece, 3) differ [rad]."""
    away = (landed.on - landed.home)[node]
    return np.asarray(np.sqrt(((away - away[:, [1, 2, 0]]) ** 2).sum(axis=2)).max(axis=1, initial=0.0))


def _barycentre(corners: FloatArray) -> FloatArray:
    """(triangle, 3) barycentric coordinates of zero in triangles (triangle, 3, 2); far off where they have no area."""
    edges = corners[:, 1:] - corners[:, :1]
    area = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    usable = np.abs(area) > 1e-18
    scale = np.where(usable, 1.0 / np.where(usable, area, 1.0), 0.0)
    at = -corners[:, 0]
    second = scale * (at[:, 0] * edges[:, 1, 1] - at[:, 1] * edges[:, 1, 0])
    third = scale * (edges[:, 0, 0] * at[:, 1] - edges[:, 0, 1] * at[:, 0])
    return np.where(usable[:, None], np.stack([1.0 - second - third, second, third], axis=1), -1.0)


def _twists(corners: FloatArray, bends: FloatArray) -> FloatArray:
    """(face, 3, 3, 3) gradient over each face, its first axis, [1/m^2] of the `bends` (face, 3, 3, 3) at its `corners`
    (face, 3, 3) [m]."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    square = np.maximum((across**2).sum(axis=1), 1e-300)[:, None]
    found = np.zeros((len(corners), 3, 3, 3))
    for corner in range(3):
        edge = corners[:, (corner + 2) % 3] - corners[:, (corner + 1) % 3]
        slope = np.cross(across, edge) / square
        found += slope[:, :, None, None] * bends[:, corner][:, None]
    return found
