"""Paths of Sionna's solvers as :class:`~rfgen_sionna.records.RadarPaths`.

Sionna computes in single precision, which is too coarse for delays. They are recomputed in double precision by
mirroring the receiver's elements in the reflecting triangles; points of diffuse reflection, diffraction and sensing
targets keep their single-precision positions.
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
"""Label of the path from Tx to Rx without an interaction."""
_NULL = 1e-6
"""Least field gain of an antenna, over isotropic: below it the unit gain is undefined."""
_NEGLIGIBLE = 1e-3
"""Relative gain change over half the band up to which dispersion is dropped."""


def from_sionna(paths: Any, radar: Radar, *, time: float = 0.0, scene: Any = None) -> RadarPaths:
    """Convert the result of `sionna.rt.PathSolver` or `sionna.rt.rcs.RCSSolver` for one radar.

    Add the radar to the scene (:func:`rfgen_sionna.scene.add_radar`), tune the scene to the radar's band, and solve
    with `synthetic_array=False`. Paths of other devices are dropped, and duplicates
    (:func:`~rfgen_sionna.tracing.sionna.path_entries.without_duplicates`). Direct paths from Tx to Rx stay; `los=False`
    in the solver, or `select(paths.bounces > 0)`, drops them.

    Gains are Sionna's, divided by the field gains of its antennas. Over the band they scale with the wavelength, with
    its power 3/2 for diffraction; the dispersion of materials is unknown. Phases of diffuse paths are arbitrary, as in
    Sionna. A path that is missing in an element pair has no gain there. Delays need the scene's surfaces where the
    solver found them; otherwise they have the precision of the interaction points.

    Parameters
    ----------
    paths
        `sionna.rt.Paths`.
    radar
        The radar at its position; for a moving one `radar.at(t)`.
    time
        Time of the solved scene [s].
    scene
        The paths' `sionna.rt.Scene` or `RadarScene`, for the names of sensing targets; None numbers them.

    Returns
    -------
    Paths with a single knot, shortest first. Objects and parts are Sionna's objects, and `direct`; the label of a path
    is its sensing target, else its first interaction other than refraction.

    Raises
    ------
    TypeError
        If `paths`, the radar or the scene has another type.
    ValueError
        If the time is not finite, or the paths are for synthetic arrays, another frequency, elements of several
        polarisations, or another radar.
    """
    frequency = _check(paths, radar)
    if not is_number(time):
        raise ValueError(f"time is {time!r}: give a finite time [s]")
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
        """(entry,) as (tx, rx, path, time), with the path's mean for missing element pairs."""
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
    """Frequency of the paths [Hz]; raises for anything other than a radar's paths."""
    ensure_backend()
    import sionna.rt

    if not isinstance(paths, sionna.rt.Paths):
        raise TypeError(
            f"paths is a {type(paths).__name__}: give the sionna.rt.Paths of a solver, not its `cir`, `cfr` or `taps`"
        )
    if not isinstance(radar, Radar):
        raise TypeError(f"radar is a {type(radar).__name__}: give the rfgen_sionna.Radar of the paths")
    if paths.synthetic_array:
        raise ValueError(
            "paths.synthetic_array is True: its plane-wave phases across the array are wrong at indoor ranges; call "
            "the solver with synthetic_array=False"
        )
    for end, array in (("tx", paths.tx_array), ("rx", paths.rx_array)):
        kinds = len(array.antenna_pattern.patterns)
        if kinds != 1:
            raise ValueError(f"paths.{end}_array has {kinds} polarisations per element: give it one, as the radar has")
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
    """(path, 3) unit vectors from the phase centre (direct paths: Tx, Rx) to the first and last interaction, means over
    pairs."""
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
    """Object names, (path,) object index, and (path,) face of the object, -1 without a single one."""
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
