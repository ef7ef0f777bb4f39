"""Paths of Sionna's own solvers as :class:`~rfgen_sionna.records.RadarPaths`.

Sionna computes in single precision. Gains, directions and Doppler shifts lose nothing by that. A delay does: it is
right to some 1e-7 of the largest coordinate, in a town a good part of a wavelength. So delays are computed anew
in double precision, from the radar's element positions, by mirroring the receiver in the very triangles that reflect a
path: what remains, for specular and refracted paths, is the rounding of the scene's own vertices. Where a path is
pinned to a point (diffuse reflection, diffraction, a scattering point of a sensing target) its delay is that by way of
this point, rounded to single precision as it is.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.profile import is_number
from rfgen_sionna.records import PathKind, RadarPaths
from rfgen_sionna.scene.devices import sionna_scene
from rfgen_sionna.scene.mesh import unit
from rfgen_sionna.scene.mitsuba_backend import ensure_backend
from rfgen_sionna.tracing.sionna.path_entries import (
    DIFFRACTION,
    DIFFUSE,
    REFRACTION,
    SENSING,
    SPECULAR,
    PathEntries,
    match_paths,
    path_lengths,
    read_entries,
    shape_names,
    without_duplicates,
)

DIRECT = "direct"
"""What labels call the path from a Tx to an Rx element without an interaction."""
_NULL = 1e-6  # of an isotropic element's field: in a null of its antenna no gain can be told
_NEGLIGIBLE = 1e-3  # relative change of a gain over half the band


def from_sionna(paths: Any, radar: Radar, *, time: float = 0.0, scene: Any = None) -> RadarPaths:
    """Convert what `sionna.rt.PathSolver` or `sionna.rt.rcs.RCSSolver` found for one radar.

    The radar must stand in the scene (:func:`rfgen_sionna.scene.add_radar`), the scene be tuned to the radar's band,
    and the solver be called with `synthetic_array=False`. Paths to and from other devices are left out. All else that
    the solver found is kept, once (:func:`~rfgen_sionna.tracing.sionna.path_entries.without_duplicates`), the direct
    paths from Tx to Rx elements included: `los=False` in the solver, or `select(paths.bounces > 0)`, leaves those out.

    Gains are Sionna's, divided by the field gains of its antennas. Over the band they go with the wavelength (with its
    power 3/2 where the path is diffracted); how a material's or a slab's coefficients change over it is not known.
    The coherent sum of diffuse paths is as arbitrary as in Sionna, their power is right. A path is followed through
    the element pairs; where it is missing in one it has no gain there. Delays are recomputed in double precision (see
    the module), from surfaces that must still be where they were when the solver ran; otherwise they have the
    precision of the path's interaction points.

    Parameters
    ----------
    paths
        `sionna.rt.Paths`
    radar
        The radar whose paths are wanted, at its place (for one that moves: `radar.at(t)`).
    time
        When the scene was as it was solved [s], on the clock that synthesis uses.
    scene
        The `sionna.rt.Scene` or `RadarScene` of the paths: gives sensing targets their names in the labels.

    Returns
    -------
    Paths with a single knot, shortest first. Objects and parts are Sionna's objects, and `direct`; a path is told by
    its sensing target where it has one, else by what it meets first, panes that it only passes aside.

    Raises
    ------
    TypeError
        If `paths` are no `sionna.rt.Paths`, or the radar or the scene is none.
    ValueError
        If the time is not finite, or the paths were computed for synthetic arrays, for another frequency, for elements
        of several polarisations, or without this radar.
    """
    frequency = _check(paths, radar)
    if not is_number(time):
        raise ValueError(f"time is {time!r}: a finite instant [s] is needed")
    inside = None if scene is None else sionna_scene(scene)
    entries = read_entries(paths, radar)
    entries = entries.take(without_duplicates(entries, radar.tx_world[entries.tx], radar.rx_world[entries.rx]))
    length = path_lengths(entries, radar.tx_world[entries.tx], radar.rx_world[entries.rx])
    order = np.argsort(length, kind="stable")
    entries, length = entries.take(order), length[order]
    places = np.concatenate([radar.tx_world, radar.rx_world])
    aperture = float(np.linalg.norm(places[:, None] - places[None], axis=-1).max())
    pair = entries.tx * len(radar.rx_world) + entries.rx
    number, first = match_paths(pair, entries.signature, entries.vertices, 1e-3 + 2 * aperture)
    count = len(first)

    def spread(values: FloatArray) -> FloatArray:
        """(entry,) as (tx, rx, path, time); the path's mean where it is missing in an element pair."""
        mean = np.bincount(number, weights=values, minlength=count) / np.bincount(number, minlength=count)
        out = np.tile(mean[:, None], (len(radar.tx_world), len(radar.rx_world), 1, 1))
        out[entries.tx, entries.rx, number, 0] = values
        return out

    tau = spread(length / SPEED_OF_LIGHT)
    a: ComplexArray = np.zeros(tau.shape, dtype=np.complex128)
    a[entries.tx, entries.rx, number, 0] = _unit_gains(paths, entries, radar)
    types = entries.types[first]
    slope = 0.5 * radar.waveform.bandwidth / frequency * (1.0 + 0.5 * (types == DIFFRACTION).sum(axis=1))
    changes = bool(slope.max(initial=0.0) > _NEGLIGIBLE)
    direction, arrival = _directions(entries, number, count, radar)
    names, object_id, facet = _labels(entries, number, first, inside)
    return RadarPaths(
        a=a,
        tau=tau,
        tau_rate=spread(-entries.doppler / frequency),
        times=np.array([float(time)]),
        frequency=frequency,
        direction=direction[:, None],
        arrival=arrival[:, None],
        object_id=object_id,
        part_id=object_id.copy(),
        kind=_kinds(types),
        bounces=(types > 0).sum(axis=1).astype(np.uint8),
        object_names=names,
        part_names=names,
        facet=facet,
        dispersion=-(a * slope[:, None])[None] if changes else None,
        half_band=0.5 * radar.waveform.bandwidth if changes else 0.0,
    )


def _check(paths: Any, radar: Radar) -> float:
    """The frequency of the paths [Hz], after refusing what are no paths of a radar."""
    ensure_backend()
    import sionna.rt

    if not isinstance(paths, sionna.rt.Paths):
        raise TypeError(
            f"paths: {type(paths).__name__} given, the sionna.rt.Paths that a solver returns are needed (its `cir`, "
            "`cfr` and `taps` are no paths any more, and by default their delays count from the first one)"
        )
    if not isinstance(radar, Radar):
        raise TypeError(f"radar: {type(radar).__name__} given, the rfgen_sionna.Radar that the paths are of is needed")
    if paths.synthetic_array:
        raise ValueError(
            "paths.synthetic_array is True: across the array the phases are those of plane waves, which errs by "
            "degrees at indoor ranges; call the solver with synthetic_array=False"
        )
    for end, array in (("tx", paths.tx_array), ("rx", paths.rx_array)):
        kinds = len(array.antenna_pattern.patterns)
        if kinds != 1:
            raise ValueError(f"paths.{end}_array has {kinds} polarisations per element; a radar's elements have one")
    # Sionna has no public name for the frequency that paths were computed for.
    frequency = float(paths._frequency[0])
    centre, half_band = radar.center_frequency, 0.5 * radar.waveform.bandwidth
    if abs(frequency - centre) > max(half_band, 1e-6 * centre):
        raise ValueError(
            f"paths are for {frequency / 1e9:.6g} GHz; radar '{radar.name}' samples {(centre - half_band) / 1e9:.6g} "
            f"to {(centre + half_band) / 1e9:.6g} GHz: tune the scene to radar.center_frequency before solving"
        )
    return centre if abs(frequency - centre) <= 1e-6 * centre else frequency


def _unit_gains(paths: Any, entries: PathEntries, radar: Radar) -> ComplexArray:
    """(entry,) gains for elements of unit gain."""
    points = entries.nodes(radar.tx_world[entries.tx], radar.rx_world[entries.rx])
    before = points[np.arange(len(entries)), entries.depth]
    sent = _field_gain(paths.tx_array, unit(points[:, 1] - points[:, 0]) @ radar.rotation)
    received = _field_gain(paths.rx_array, unit(before - points[:, -1]) @ radar.rotation)
    usable = (sent > _NULL) & (received > _NULL)
    return np.asarray(np.where(usable, entries.a, 0.0) / np.where(usable, sent * received, 1.0), dtype=np.complex128)


def _field_gain(array: Any, directions: FloatArray) -> FloatArray:
    """(entry,) field gain of Sionna's antenna towards `directions` (entry, 3) in the device frame."""
    import mitsuba

    if len(directions) == 0:  # Dr.Jit aborts the process on empty arrays
        return np.zeros(0)
    mi: Any = mitsuba
    theta = np.arccos(np.clip(directions[:, 2], -1.0, 1.0))
    phi = np.arctan2(directions[:, 1], directions[:, 0])
    fields = array.antenna_pattern.patterns[0](mi.Float(theta), mi.Float(phi))
    power = sum(np.square(part.numpy().astype(np.float64)) for field in fields for part in (field.real, field.imag))
    return np.sqrt(np.broadcast_to(power, len(directions)))


def _directions(
    entries: PathEntries, number: NDArray[np.intp], count: int, radar: Radar
) -> tuple[FloatArray, FloatArray]:
    """(path, 3) from the phase centre to the first and to the last interaction, means over the element pairs.

    A direct path goes from the Tx to the Rx elements, whatever the phase centre.
    """
    tx, rx = radar.tx_world[entries.tx], radar.rx_world[entries.rx]
    points, direct = entries.nodes(tx, rx), (entries.depth == 0)[:, None]
    before = points[np.arange(len(entries)), entries.depth]
    weight = 1.0 / np.bincount(number, minlength=count)[number]

    def towards(ends: FloatArray, fallback: FloatArray) -> FloatArray:
        offsets = np.where(direct, fallback, ends - np.asarray(radar.position)) * weight[:, None]
        return unit(np.stack([np.bincount(number, weights=part, minlength=count) for part in offsets.T], axis=1))

    return towards(points[:, 1], rx - tx), towards(before, tx - rx)


def _kinds(types: NDArray[np.int64]) -> NDArray[np.uint8]:
    """(path,) values of `PathKind` for interaction types (path, depth)."""
    turns = ((types > 0) & (types != REFRACTION)).sum(axis=1)
    kinds = np.where(turns > 1, PathKind.MULTI_BOUNCE, PathKind.SPECULAR)
    return np.where((types == DIFFUSE).any(axis=1), PathKind.DIFFUSE, kinds).astype(np.uint8)


def _labels(
    entries: PathEntries, number: NDArray[np.intp], first: NDArray[np.intp], scene: Any
) -> tuple[tuple[str, ...], IntArray, IntArray]:
    """Names of all objects, and per path the index of its object and its face there (-1 where it has no single one)."""
    types, objects = entries.types[first], entries.objects[first]
    targets = list(scene.sensing_targets) if scene is not None else []
    shapes = sorted({int(shape) for shape in objects[(types > 0) & (types != SENSING)]})
    by_shape = shape_names(shapes)
    labelled = np.select(
        [(types == SENSING).any(axis=1), ((types > 0) & (types != REFRACTION)).any(axis=1)],
        [(types == SENSING).argmax(axis=1), ((types > 0) & (types != REFRACTION)).argmax(axis=1)],
        0,
    )
    names: dict[str, int] = {DIRECT: 0}
    object_id = np.zeros(len(first), dtype=np.int32)
    for path, depth in enumerate(labelled.tolist()):
        kind, thing = int(types[path, depth]), int(objects[path, depth])
        if kind == SENSING:
            name = targets[thing] if thing < len(targets) else f"sensing target {thing}"
        else:
            name = by_shape[thing] if kind else DIRECT
        object_id[path] = names.setdefault(name, len(names))
    faces = entries.primitives[np.arange(len(entries)), labelled[number]]
    wanders = np.bincount(number, weights=faces != faces[first][number], minlength=len(first)) > 0
    owned = ~wanders & np.isin(types[np.arange(len(first)), labelled], (SPECULAR, DIFFUSE, REFRACTION))
    return tuple(names), object_id, np.where(owned, faces[first], -1).astype(np.int32)
