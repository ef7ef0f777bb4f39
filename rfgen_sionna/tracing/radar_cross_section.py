"""Radar cross-section of a mesh by physical optics, monostatic and bistatic.

With the scattering amplitude S [m] of Sionna's sensing (:mod:`rfgen_sionna.tracing.sionna.far_field`) the cross-section
is |S|^2 [m^2], as E_s = S E_i exp(-j k r) / (sqrt(4 pi) r) (E. F. Knott, J. F. Shaeffer and M. T. Tuley, Radar Cross
Section, 2nd ed., 2004, ch. 3 and 5).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.profile import is_number
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.mesh_actor import MeshActor
from rfgen_sionna.tracing.max_bounces import check_max_bounces
from rfgen_sionna.tracing.relative_scene import RelativeObject, by_material
from rfgen_sionna.tracing.surface.smoothing import find_smoothing
from rfgen_sionna.tracing.tracer import Tracer

LEAST_SIZE = 3.0
"""Least k a, wavenumber times half the size of the mesh, for physical optics."""
OPTICS_ERROR = 2.0
"""Error of physical optics relative to the cross-section, times k a: of spheres against Mie's series."""
CURVED_BISTATIC_ERROR = 2.0
"""The same of curved surfaces in bistatic directions, times the root of k a, over the sine of half the bistatic angle:
the boundary between the parts that one end sees and both ends see diffracts in physical optics alone."""
MAX_BISTATIC = 150.0
"""Largest bistatic angle [degrees]: beyond it the wave that casts the shadow counts, which is left out."""
FAR, MIN_FAR, MAX_FAR = 0.02, 50.0, 4000.0
"""Two-way phase [rad] over the mesh at the distance of monostatic far fields; least and largest distance over the size
of the mesh, as rays in single precision resolve a thousandth of it."""
DISTANCE_ERROR = 0.2
"""Error of the cross-section per radian of that phase."""


@dataclass(frozen=True, repr=False)
class RadarCrossSection(ShortRepr):
    """Radar cross-section over directions; arrays have the shape of the directions."""

    rcs: FloatArray
    """[m^2]"""
    error: FloatArray
    """Estimated error relative to `rcs`: of the integration, of shadows, of the distance and of physical optics."""
    azimuth: FloatArray
    """Direction from the mesh to the receiver [degrees], from +x towards +y."""
    elevation: FloatArray
    """The same [degrees], from the horizon towards +z."""
    frequency: float
    """[Hz]"""
    polarization: str
    """Of the transmitter and of the receiver: "VV", "HH", "VH" or "HV"."""
    amplitude: ComplexArray
    """Scattering amplitude [m], with the phase of a scatterer at the mesh's origin as 0; `rcs` is its square."""
    incident: tuple[float, float] | None = None
    """Azimuth and elevation of the transmitter [degrees]; None is the receiver's (monostatic)."""

    @property
    def dbsm(self) -> FloatArray:
        """Cross-section [dB relative to 1 m^2]; -inf where it is 0."""
        with np.errstate(divide="ignore"):
            return np.asarray(10.0 * np.log10(self.rcs))

    @property
    def error_db(self) -> FloatArray:
        """Error of `dbsm` [dB] upwards."""
        return np.asarray(10.0 * np.log10(1.0 + self.error))

    def _facts(self) -> Iterable[str]:
        yield f"{self.rcs.size} direction{'' if self.rcs.size == 1 else 's'}"
        yield f"{self.frequency / 1e9:g} GHz {self.polarization}"
        yield "monostatic" if self.incident is None else f"from azimuth, elevation {self.incident}°"
        if self.rcs.size:
            dbsm, error = self.dbsm, self.error_db
            yield f"{dbsm.min():.2f} … {dbsm.max():.2f} dBsm" if dbsm.size > 1 else f"{float(dbsm.max()):.2f} dBsm"
            yield f"error up to {error.max():.2g} dB"


def rcs(
    mesh: Any,
    frequency: float,
    azimuth: ArrayLike = 0.0,
    elevation: ArrayLike = 0.0,
    *,
    material: str | Material | None = None,
    polarization: str = "VV",
    incident: tuple[float, float] | None = None,
    max_bounces: int | None = 1,
    distance: float | None = None,
    rtol: float = 1e-2,
) -> RadarCrossSection:
    """Radar cross-section of a mesh [m^2] by physical optics, with its error.

    Faces see the incident wave by Fresnel's coefficients and shadow one another; `max_bounces` adds reflections between
    them. Diffraction at edges and creeping waves are left out: lobes far below the largest are less accurate than
    `error`, which is that of strong directions.

    Parameters
    ----------
    mesh
        Path of a mesh file, `trimesh.Trimesh`, pair (vertices, faces) in metres, or an Actor, whose shape at t = 0 and
        materials count, without its place in the world.
    frequency
        [Hz]
    azimuth, elevation
        Directions from the mesh to the receiver [degrees] in its frame (+x front, +y left, +z up), of shapes that
        broadcast.
    material
        Material of a mesh, a name or :func:`rfgen_sionna.material`; None takes those that a file names, and metal for
        parts without. Actors have their own.
    polarization
        Polarisation of transmitter and receiver: "VV", "HH", or "VH" and "HV" for cross-polarised ones. V is in the
        plane of the direction and +z.
    incident
        Azimuth and elevation of the transmitter [degrees] for a bistatic cross-section; None is monostatic.
    max_bounces
        Largest number of surfaces on a path, 1 … 3, or None for 3: 2 has dihedrals, 3 trihedrals. Monostatic only.
    distance
        Distance from the middle of the mesh [m] for a cross-section in the near field, monostatic only; None is the
        far field.
    rtol
        Tolerated relative error of the amplitude of monostatic returns, 1e-6 … 0.1.

    Raises
    ------
    ValueError
        An argument is out of range: the mesh is too small for physical optics (k a below `LEAST_SIZE`, half its size
        a), the bistatic angle is above `MAX_BISTATIC`, or the far field of the mesh is out of reach of its ray tracing.
    MeshError, FileNotFoundError
        The mesh is not usable.
    """
    parts, middle, size = _parts(mesh, material)
    if not (is_number(frequency) and 1e8 <= frequency <= 1e12):
        raise ValueError(f"frequency is {frequency!r} Hz: a value in 1e8 … 1e12 Hz is needed")
    polarization = polarization.upper() if isinstance(polarization, str) else polarization
    if polarization not in ("VV", "HH", "VH", "HV"):
        raise ValueError(f"polarization is {polarization!r}: 'VV', 'HH', 'VH' or 'HV' is needed")
    if not (is_number(rtol) and 1e-6 <= rtol <= 0.1):
        raise ValueError(f"rtol is {rtol!r}: a value in 1e-6 … 0.1 is needed")
    if distance is not None and not (is_number(distance) and distance > size):
        raise ValueError(f"distance is {distance!r}: more than {size:.4g} m, the size of the mesh, is needed")
    bounces = check_max_bounces(max_bounces)
    wavenumber = 2 * np.pi * frequency / SPEED_OF_LIGHT
    if 0.5 * wavenumber * size < LEAST_SIZE:
        raise ValueError(
            f"mesh is {size:.3g} m wide, k a is {0.5 * wavenumber * size:.2g} at {frequency / 1e9:g} GHz: physical "
            f"optics needs at least {LEAST_SIZE:g}, {2 * LEAST_SIZE / wavenumber:.3g} m; take a full-wave solver for it"
        )
    for own in parts:
        own.properties.check(frequency, own.name)
    towards = _directions("azimuth, elevation", azimuth, elevation)
    azimuths, elevations = np.broadcast_arrays(*(np.asarray(each, np.float64) for each in (azimuth, elevation)))
    if incident is None:
        found = _monostatic(parts, middle, size, towards, frequency, polarization, bounces, distance, rtol)
    else:
        if bounces > 1 or distance is not None:
            name, value = ("max_bounces", max_bounces) if bounces > 1 else ("distance", distance)
            raise ValueError(f"{name} is {value!r}: bistatic cross-sections are single reflections in the far field")
        start = _directions("incident", *_pair(incident))
        found = _bistatic(parts, middle, size, start, towards, frequency, polarization)
    amplitude, missed = found[0].reshape(azimuths.shape), found[1].reshape(azimuths.shape)
    power = np.abs(amplitude) ** 2
    error = np.hypot(missed, OPTICS_ERROR / (0.5 * wavenumber * size))
    ends = None if incident is None else (float(incident[0]), float(incident[1]))
    return RadarCrossSection(
        power, error, azimuths.copy(), elevations.copy(), float(frequency), polarization, amplitude, ends
    )


def _parts(mesh: Any, material: str | Material | None) -> tuple[list[RelativeObject], FloatArray, float]:
    """Parts of one material each about the middle of the mesh, the middle (3,) [m] and the size [m]."""
    if not isinstance(mesh, MeshActor):
        default = "metal" if material is None else None
        actor = MeshActor.from_mesh(mesh, material=material or "", default_material=default, name="mesh")
    elif material is None:
        actor = mesh
    else:
        raise ValueError(f"material is {material!r}: the actor {mesh.name!r} has its own, leave it out")
    shape = replace(actor, position=(0, 0, 0), orientation=(0, 0, 0), velocity=(0, 0, 0), trajectory=None)
    points = shape.vertices(0.0)[np.unique(shape.faces)]
    low, high = points.min(axis=0), points.max(axis=0)
    middle = 0.5 * (low + high)
    size = 2.0 * float(lengths(points - middle).max())
    found = []
    for own in by_material([shape]):
        known = own.name, own.properties, own.faces, own.part_names, own.face_parts, False
        points = np.asarray(own.vertices(0.0), np.float64) - middle
        found.append(RelativeObject(*known, _still(points), own.rest_vertices))
    return found, middle, size


def _still(points: FloatArray) -> Callable[[float], FloatArray]:
    return lambda _: points


def _pair(incident: Any) -> tuple[Any, Any]:
    try:
        azimuth, elevation = incident
    except (TypeError, ValueError):
        raise ValueError(f"incident is {incident!r}: a pair (azimuth, elevation) [degrees] or None is needed") from None
    return azimuth, elevation


def _directions(name: str, azimuth: ArrayLike, elevation: ArrayLike) -> FloatArray:
    """(direction, 3, 3) unit vectors, rows, of each direction: towards it, to its left, and of vertical fields."""
    try:
        ends = np.broadcast_arrays(np.asarray(azimuth, np.float64), np.asarray(elevation, np.float64))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: angles [degrees] of shapes that broadcast are needed ({error})") from None
    az, el = (np.radians(each.ravel()) for each in ends)
    if not (np.isfinite(az).all() and np.isfinite(el).all() and (np.abs(el) <= np.pi / 2 + 1e-9).all()):
        raise ValueError(f"{name}: finite angles [degrees] are needed, elevations of -90 … 90")
    if not az.size:
        raise ValueError(f"{name}: no angles given")
    zero = np.zeros_like(az)
    towards = np.stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)], axis=-1)
    left = np.stack([-np.sin(az), np.cos(az), zero], axis=-1)
    return np.stack([towards, left, np.cross(towards, left)], axis=1)


def _monostatic(
    parts: list[RelativeObject],
    middle: FloatArray,
    size: float,
    towards: FloatArray,
    frequency: float,
    polarization: str,
    max_bounces: int,
    distance: float | None,
    rtol: float,
) -> tuple[ComplexArray, FloatArray]:
    """(direction,) amplitudes [m] and errors of the cross-section, by the tracer with a distant radar on +x and the
    mesh turned."""
    wavenumber, missed = 2 * np.pi * frequency / SPEED_OF_LIGHT, 0.0
    if distance is None:
        curved = 0.25 * wavenumber * size**2
        distance = float(np.clip(curved / FAR, MIN_FAR * size, MAX_FAR * size))
        missed = DISTANCE_ERROR * curved / distance
        if curved / distance > 1.0:
            raise ValueError(
                f"mesh is {size:.3g} m wide, its far field at {frequency / 1e9:g} GHz begins beyond {2 * curved:.3g} m,"
                f" out of reach of ray tracing ({distance:.3g} m): give a distance [m], for its near field"
            )

    def turned(part: RelativeObject) -> RelativeObject:
        corners = part.vertices(0.0)
        return replace(part, vertices=lambda t: corners @ towards[int(np.rint(t))].T)

    radar = _distant_radar(frequency, polarization, distance, size)
    tracer = Tracer(None, radar, [turned(part) for part in parts], rtol, max_bounces=max_bounces)
    amplitudes, errors = np.zeros(len(towards), np.complex128), np.zeros(len(towards))
    scale = (4 * np.pi) ** 1.5 * distance**2 * frequency / SPEED_OF_LIGHT
    for number in range(len(towards)):
        traced = tracer.trace(float(number), float(number))
        for paths in traced.actors:
            phase = np.mod(frequency * (paths.tau[0, 0, :, 0] - 2.0 * distance / SPEED_OF_LIGHT), 1.0)
            amplitudes[number] += scale * np.sum(paths.a[0, 0, :, 0] * np.exp(-2j * np.pi * phase))
        errors[number] = 2.0 * traced.report.error
    return amplitudes * np.exp(2j * wavenumber * (towards[:, 0] @ middle)), np.hypot(errors, missed)


def _distant_radar(frequency: float, polarization: str, distance: float, size: float) -> Radar:
    """Constant wave on +x, with a Tx and an Rx element at one place."""
    base = Radar.load("position2go", preset="doppler")
    wave = replace(base.waveform, start_frequency=frequency, slope=0.0, range_limit=distance + 2.0 * size)
    return replace(
        base,
        waveform=wave,
        rx_names=base.rx_names[:1],
        tx_positions=np.zeros((1, 3)),
        rx_positions=np.zeros((1, 3)),
        tx_polarization=polarization[0],
        rx_polarization=polarization[1],
        frequency_range=None,
        position=(distance, 0.0, 0.0),
        orientation=(np.pi, 0.0, 0.0),
    )


def _bistatic(
    parts: list[RelativeObject],
    middle: FloatArray,
    size: float,
    start: FloatArray,
    towards: FloatArray,
    frequency: float,
    polarization: str,
) -> tuple[ComplexArray, FloatArray]:
    """(direction,) amplitudes [m] and errors of the cross-section from one direction `start` (1, 3, 3), by sums over
    facets in the far field; the error is the change from facets twice as wide."""
    from rfgen_sionna.tracing.sionna.scattering_amplitude import scattering_amplitudes

    if len(start) != 1:
        raise ValueError(f"incident has {len(start)} directions: a single one is needed")
    angle = np.degrees(np.arccos(np.clip(towards[:, 0] @ start[0, 0], -1.0, 1.0)))
    if angle.max(initial=0.0) > MAX_BISTATIC:
        raise ValueError(
            f"incident: the bistatic angle is {angle.max():.4g}°, up to {MAX_BISTATIC:g}° are allowed: forward "
            "scattering, the shadow of the mesh, is left out"
        )
    fine, coarse = (scattering_amplitudes(parts, size, start, towards, frequency, polarization, n) for n in (48, 24))
    missed = np.abs(fine - coarse) / np.maximum(np.abs(fine), 1e-300)
    wavenumber = 2 * np.pi * frequency / SPEED_OF_LIGHT
    if any(find_smoothing(part.rest_vertices, part.faces) is not None for part in parts):
        curved = CURVED_BISTATIC_ERROR * np.sin(np.radians(0.5 * angle)) / np.sqrt(0.5 * wavenumber * size)
        missed = np.hypot(missed, 0.5 * curved)
    return fine * np.exp(1j * wavenumber * ((towards[:, 0] + start[:, 0]) @ middle)), 2.0 * missed
