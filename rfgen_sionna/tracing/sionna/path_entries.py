"""Paths of one radar in `sionna.rt.Paths` as flat arrays, with lengths in double precision."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.mitsuba_backend import ensure_backend

SPECULAR, DIFFUSE, REFRACTION, DIFFRACTION, SENSING = 1, 2, 4, 8, 16
"""Sionna's `InteractionType`; 0 is no interaction."""
FIXED_POINT = (DIFFUSE, DIFFRACTION, SENSING)
"""Interactions at a point that the image method does not determine."""
_POSITION_RTOL = 1e-6
"""Largest mismatch of element positions over the largest coordinate: single-precision rounding of a rotation."""
_SURFACE_RTOL = 3e-6
"""Largest distance of an interaction point from its triangle's plane over the largest coordinate, likewise."""


@dataclass(frozen=True)
class PathEntries:
    """Valid paths of all element pairs of one radar in a row."""

    tx: NDArray[np.intp]
    """(entry,) Tx element."""
    rx: NDArray[np.intp]
    """(entry,) Rx element."""
    a: ComplexArray
    """(entry,) gains with element patterns."""
    doppler: FloatArray
    """(entry,) [Hz], positive for approach."""
    types: NDArray[np.int64]
    """(entry, depth) interaction types."""
    objects: NDArray[np.int64]
    """(entry, depth) Mitsuba's shape number, or the target's index for SENSING."""
    primitives: NDArray[np.int64]
    """(entry, depth) face of the shape, or the scattering point of the target for SENSING."""
    vertices: FloatArray
    """(entry, depth, 3) interaction points [m]."""

    def __len__(self) -> int:
        return len(self.tx)

    def take(self, chosen: NDArray[np.intp]) -> PathEntries:
        return PathEntries(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))

    @property
    def depth(self) -> NDArray[np.intp]:
        """(entry,) number of interactions."""
        return np.asarray((self.types > 0).sum(axis=1), dtype=np.intp)

    @property
    def signature(self) -> NDArray[np.int64]:
        """(entry, …) interactions that a path has in common for all element pairs."""
        point = np.where(self.types == SENSING, self.primitives, 0)
        return np.concatenate([self.types, np.where(self.types > 0, self.objects, 0), point], axis=1)

    def nodes(self, tx: FloatArray, rx: FloatArray) -> FloatArray:
        """(entry, depth + 2, 3) points from `tx` to `rx` (entry, 3) [m]; the last one is repeated."""
        points = np.concatenate([tx[:, None], self.vertices, rx[:, None]], axis=1)
        beyond = np.arange(points.shape[1]) > self.depth[:, None]
        return np.where(beyond[..., None], rx[:, None], points)


def read_entries(paths: Any, radar: Radar) -> PathEntries:
    """Paths from the radar's Tx elements to its Rx elements.

    Raises
    ------
    ValueError
        If no transmitter or no receiver of the scene has the radar's element positions.
    """
    sender = _device(paths.sources, paths.num_tx, radar.tx_world, radar, "transmitter")
    listener = _device(paths.targets, paths.num_rx, radar.rx_world, radar, "receiver")
    rx, tx, path = np.nonzero(paths.valid.numpy()[listener, :, sender])

    def each(tensor: Any) -> NDArray[Any]:
        return np.asarray(tensor.numpy()[listener, rx, sender, tx, path])

    def each_depth(tensor: Any, kind: type) -> NDArray[Any]:
        values = np.moveaxis(tensor.numpy()[:, listener, rx, sender, tx, path], 0, 1).astype(kind)
        # At least one (empty) interaction, to avoid a special case.
        return values if values.shape[1] else np.zeros((len(values), 1, *values.shape[2:]), kind)

    real, imaginary = (each(part).astype(np.float64) for part in paths.a)
    return PathEntries(
        tx=tx,
        rx=rx,
        a=real + 1j * imaginary,
        doppler=each(paths.doppler).astype(np.float64),
        types=each_depth(paths.interactions, np.int64),
        objects=each_depth(paths.objects, np.int64),
        primitives=each_depth(paths.primitives, np.int64),
        vertices=each_depth(paths.vertices, np.float64),
    )


def _device(positions: Any, devices: int, elements: FloatArray, radar: Radar, kind: str) -> int:
    """Index of the scene's device with `elements` (element, 3) [m]."""
    places = positions.numpy().astype(np.float64).T
    if len(places) == devices * len(elements):
        off = np.abs(places.reshape(devices, len(elements), 3) - elements).max(axis=(1, 2))
        if off.min() <= _POSITION_RTOL * max(1.0, float(np.abs(elements).max())):
            return int(off.argmin())
    near = float(np.linalg.norm(places - np.asarray(radar.position), axis=1).min())
    raise ValueError(
        f"radar '{radar.name}': none of the {devices} {kind}s of these paths has the radar's {len(elements)} element "
        f"positions ({len(places)} elements in all, the nearest {near:.6g} m from the radar's position "
        f"{radar.position} m); add the radar to the scene with rfgen_sionna.scene.add_radar before solving"
    )


def path_lengths(entries: PathEntries, tx: FloatArray, rx: FloatArray) -> FloatArray:
    """(entry,) lengths [m] from `tx` to `rx` (entry, 3), in double precision.

    Between fixed points the length is that to the image in the planes of the reflecting triangles, without Sionna's
    rounded interaction points; refraction is straight, as in Sionna. Where a triangle has moved since, the points are
    used.
    """
    points = entries.nodes(tx, rx)
    slack = _SURFACE_RTOL * np.maximum(1.0, np.abs(points).max(axis=(1, 2), initial=0.0))
    image, length = rx.copy(), np.zeros(len(entries))
    known = np.ones(len(entries), dtype=np.bool_)
    for depth in reversed(range(entries.types.shape[1])):
        types, place = entries.types[:, depth], entries.vertices[:, depth]
        mirrored = np.flatnonzero(types == SPECULAR)
        corners = _triangles(entries.objects[mirrored, depth], entries.primitives[mirrored, depth])
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        normal /= np.where(size > 0, size, 1.0)
        above, met = (((each[mirrored] - corners[:, 0]) * normal).sum(axis=1, keepdims=True) for each in (image, place))
        known[mirrored] &= (size[:, 0] > 0) & (np.abs(met[:, 0]) <= slack[mirrored])
        image[mirrored] -= 2 * above * normal
        fixed = np.isin(types, FIXED_POINT)
        length += np.where(fixed, np.linalg.norm(image - place, axis=1), 0.0)
        image[fixed] = place[fixed]
    length += np.linalg.norm(image - tx, axis=1)
    return np.where(known, length, np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1))


def without_duplicates(entries: PathEntries, tx: FloatArray, rx: FloatArray) -> NDArray[np.intp]:
    """(entry,) entries without duplicates of the path solver.

    At most one path is reflected and refracted by given triangles in a given order. Where two surfaces nearly coincide,
    the solver returns it twice; the shorter one is right.
    """
    points = entries.nodes(tx, rx)
    by_points = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
    # Diffuse and diffracted paths on the same triangles may be many.
    free = np.isin(entries.types, (DIFFUSE, DIFFRACTION)).any(axis=1)
    met = entries.types > 0
    key = np.concatenate(
        [
            np.where(free, np.arange(len(entries)), -1)[:, None],
            entries.tx[:, None],
            entries.rx[:, None],
            entries.types,
            np.where(met, entries.objects, 0),
            np.where(met, entries.primitives, 0),
        ],
        axis=1,
    )
    order = np.argsort(by_points, kind="stable")
    _, first = np.unique(key[order], axis=0, return_index=True)
    return np.sort(order[first])


def _triangles(shapes: NDArray[np.int64], faces: NDArray[np.int64]) -> FloatArray:
    """(entry, 3, 3) corners [m] of faces of Mitsuba's shapes; zeros for removed shapes."""
    if len(shapes) == 0:
        return np.zeros((0, 3, 3))
    ensure_backend()
    import drjit as dr
    import mitsuba

    mi: Any = mitsuba
    pointer: Any = dr.reinterpret_array(mi.MeshPtr, mi.UInt32(shapes.astype(np.uint32)))
    index = pointer.face_indices(mi.UInt32(faces.astype(np.uint32)))
    corners = [pointer.vertex_position(index[corner]) for corner in range(3)]
    return np.stack([corner.numpy().astype(np.float64).T for corner in corners], axis=1)


def shape_names(shapes: list[int]) -> dict[int, str]:
    """Sionna's object names of Mitsuba's shape numbers."""
    ensure_backend()
    import drjit as dr
    import mitsuba
    from sionna.rt.scene_object import SceneObject

    mi: Any = mitsuba
    pointer: Any = dr.reinterpret_array(mi.ShapePtr, mi.UInt32(shapes)) if shapes else []
    return {
        number: SceneObject.shape_id_to_name(shape.id()) if shape is not None else f"object {number}"
        for number, shape in zip(shapes, list(pointer), strict=True)
    }


def match_paths(
    pair: NDArray[np.intp], signature: NDArray[np.int64], vertices: FloatArray, reach: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """(entry,) path number of each entry, in the order of entries, and (path,) first entry of each path.

    Paths of different element pairs `pair` (entry,) match if they have the same `signature` (entry, …) and their points
    `vertices` (entry, depth, 3) are within `reach` [m] per interaction; the nearest match counts. The matching affects
    labels alone, never sums over paths.
    """
    from scipy.spatial import cKDTree

    if len(pair) == 0:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    _, group = np.unique(signature, axis=0, return_inverse=True)
    # Offset by signature beyond any distance.
    extent = 1.0 + 4.0 * float(np.abs(vertices).max(initial=0.0)) + reach
    depth = max(vertices.shape[1], 1)
    points = np.concatenate([vertices.reshape(len(pair), -1), (extent * depth * group.reshape(-1))[:, None]], axis=1)
    number = np.full(len(pair), -1, dtype=np.intp)
    known: list[int] = []
    by_pair = np.argsort(pair, kind="stable")
    starts = np.flatnonzero(np.diff(pair[by_pair], prepend=-1))
    for entries in np.split(by_pair, starts[1:]):
        if known:
            distance, nearest = cKDTree(points[known]).query(points[entries], distance_upper_bound=reach * depth**0.5)
            met = np.flatnonzero(np.isfinite(distance))
            met = met[np.argsort(distance[met], kind="stable")]
            _, chosen = np.unique(nearest[met], return_index=True)
            number[entries[met[chosen]]] = nearest[met[chosen]]
        new = entries[number[entries] < 0]
        number[new] = len(known) + np.arange(len(new))
        known.extend(new.tolist())
    # Renumber in the order of the entries.
    _, first, number = np.unique(number, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    return rank[number.reshape(-1)], np.sort(first)
