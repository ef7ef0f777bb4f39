"""Records that pass from one stage to the next.

World frame: metres, z up, Sionna's conventions; a body in its rest pose faces +x and has its left side at +y.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._short_repr import ShortRepr, name_list, short_vector, time_span
from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar


@dataclass(frozen=True, repr=False)
class Motion(ShortRepr):
    """Joint rotations of an articulated body, sampled at a fixed rate.

    Rest pose (all rotations identity): T-pose facing +x, left side at +y, z up.
    """

    rotations: FloatArray
    """(frame, joint, 4) unit quaternions, scalar last (x, y, z, w), relative to the parent joint;
    joint 0 is the world orientation of the root (pelvis)."""
    translation: FloatArray
    """(frame, 3) world position of the root joint [m]; the floor is z = 0."""
    frame_rate: float
    """Poses per second [Hz]."""
    joint_names: tuple[str, ...]
    parents: tuple[int, ...]
    """Parent index of each joint, -1 for the root; parents precede children."""
    offsets: FloatArray
    """(joint, 3) rest position of each joint relative to its parent [m]."""
    contacts: NDArray[np.bool_] | None = None
    """(frame, 2) whether the left and the right foot is planted; None for unknown contacts."""
    action: str = ""
    """Name of the action, empty for an unknown one."""
    prompt: str = ""
    seed: int | None = None
    clips: tuple[str, ...] = ()
    """Names of the library's clips that it is made of."""

    @property
    def duration(self) -> float:
        """Time between the first and the last pose [s]."""
        return (len(self.translation) - 1) / self.frame_rate

    def _facts(self) -> Iterable[str]:
        yield repr(self.action) if self.action else ""
        yield f"{len(self.translation)} poses at {self.frame_rate:g} Hz ({self.duration:.4g} s)"
        yield f"{len(self.joint_names)} joints"
        yield "" if self.seed is None else f"seed {self.seed}"


@runtime_checkable
class MeshSequence(Protocol):
    """A mesh of fixed connectivity whose vertices are smooth (C²) functions of time.

    A sequence may have `rest_vertices`, (vertex, 3) positions of the mesh at rest in metres: they tell where the
    surface is smooth. Without them the pose at t = 0 does.
    """

    @property
    def faces(self) -> IntArray:
        """(face, 3) vertex indices, counter-clockwise from outside."""

    @property
    def part_names(self) -> tuple[str, ...]:
        """Names of the parts, at least one."""

    @property
    def face_parts(self) -> IntArray:
        """(face,) index into `part_names`."""

    @property
    def duration(self) -> float:
        """Length of the sequence [s], with constant poses outside; `inf` for a rigid mesh."""

    def vertices(self, t: float) -> FloatArray:
        """(vertex, 3) positions at time `t` [s] in metres."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints; empty for a mesh without skeleton."""

    def joints(self, t: float) -> FloatArray:
        """(joint, 3) joint positions at time `t` [s] in metres."""


class PathKind(IntEnum):
    """Kind of a propagation path."""

    FACET = 0
    """Physical-optics return of one facet, or of a cluster of small ones."""
    SPECULAR = 1
    """Ray-optical path (for instance from Sionna's `PathSolver`)."""
    MULTI_BOUNCE = 2
    DIFFUSE = 3
    ENVIRONMENT = 4
    """Path of an image of the surroundings, with a random phase."""


_DIGITS, _MAX_CACHED = 13, 10_000
"""Decimals of times as shares of the knots' span, against rounding; most weights of a cached matrix, for memory."""


def knot_weights(knots: FloatArray, t: FloatArray, derivative: int = 0) -> FloatArray:
    """(len(t), len(knots)) weights of the C² not-a-knot cubic spline through values at `knots` [s].

    Fewer than four knots give the polynomial through them. `derivative` is in units of 1/s^derivative.
    """
    knots, t = np.asarray(knots, np.float64), np.atleast_1d(np.asarray(t, dtype=np.float64))
    if len(knots) == 1:
        return np.full((len(t), 1), 1.0 if derivative == 0 else 0.0)
    # Times count from the first knot: far from t = 0 the spline's polynomials would lose digits. As shares of the span
    # of the knots they are the same in all frames.
    span = float(knots[-1] - knots[0])
    places, at = (np.round((np.asarray(each) - knots[0]) / span, _DIGITS) for each in (knots, t))
    weigh = _known_weights if len(places) * len(at) <= _MAX_CACHED else _weights
    return np.asarray(weigh(places.tobytes(), at.tobytes(), derivative) / span**derivative)


def _weights(knots: bytes, t: bytes, derivative: int) -> FloatArray:
    """:func:`knot_weights` of float64 numbers."""
    from scipy.interpolate import make_interp_spline

    places = np.frombuffer(knots)
    spline = make_interp_spline(places, np.eye(len(places)), k=min(3, len(places) - 1))
    return np.asarray(spline(np.frombuffer(t), nu=derivative), dtype=np.float64)


_known_weights = lru_cache(maxsize=256)(_weights)


def interpolate_knots(weights: FloatArray, values: ComplexArray) -> ComplexArray:
    """(..., new) complex numbers at other times from `values` (..., old), by `weights` (new, old)."""
    # A product of real matrices, real and imaginary parts side by side, is faster than a complex one.
    real = np.ascontiguousarray(values, np.complex128).view(np.float64).reshape(-1, 2 * values.shape[-1])
    found = real @ np.kron(weights, np.eye(2)).T
    return found.view(np.complex128).reshape(*values.shape[:-1], len(weights))


_CHANNEL_FIELDS = ("a", "tau", "tau_rate")
_PATH_FIELDS = ("direction", "arrival", "object_id", "part_id", "kind", "bounces", "facet")


@dataclass(frozen=True, repr=False)
class RadarPaths(ShortRepr):
    """Propagation paths between every Tx and Rx element, as smooth curves in time.

    The channel of one element pair is `sum_i a_i exp(-j 2 pi f tau_i)`: as in Sionna the propagation phase is not in
    `a`. `|a|^2 G_t G_r P_t` is the received power. Between the knots `times` a path is the C² spline of
    :meth:`weights`.
    """

    a: ComplexArray
    """(tx, rx, path, time) complex gain V_rx/V_tx for elements of unit gain at `frequency`."""
    tau: FloatArray
    """(tx, rx, path, time) delay [s]."""
    tau_rate: FloatArray
    """(tx, rx, path, time) rate of the delay [s/s]; positive is receding."""
    times: FloatArray
    """(time,) knots [s], ascending. With a single knot the delay continues at its rate and the gain stays."""
    frequency: float
    """Reference frequency of the gains [Hz]."""
    direction: FloatArray
    """(path, time, 3) unit vector from the array's phase centre towards the first interaction, world frame."""
    arrival: FloatArray
    """(path, time, 3) unit vector from the array's phase centre towards the last interaction, world frame."""
    object_id: IntArray
    """(path,) index into `object_names`."""
    part_id: IntArray
    """(path,) index into `part_names`."""
    kind: NDArray[np.uint8]
    """(path,) values of :class:`PathKind`."""
    bounces: NDArray[np.uint8]
    """(path,) number of interactions."""
    object_names: tuple[str, ...]
    part_names: tuple[str, ...]
    facet: IntArray
    """(path,) face index of the path's facet within the object's mesh; -1 without a facet."""
    dispersion: ComplexArray | None = None
    """(order, tx, rx, path, time) change of the gain over the band: at frequency f it is
    `a + sum_n dispersion[n-1] ((f - frequency) / half_band)^n`. None for a negligible change."""
    half_band: float = 0.0
    """Half the band of `dispersion` [Hz]."""

    def _facts(self) -> Iterable[str]:
        num_tx, num_rx, count, knots = self.a.shape
        yield f"{count} paths × {num_tx} Tx × {num_rx} Rx × {knots} {'knot' if knots == 1 else 'knots'}"
        yield time_span(self.times)
        yield f"gains at {self.frequency / 1e9:.4g} GHz"
        if self.a.size:
            ranges, velocities = self.range, self.velocity
            yield f"ranges {ranges.min():.4g} … {ranges.max():.4g} m"
            yield f"radial velocities {velocities.min():.3g} … {velocities.max():.3g} m/s"
        yield f"objects {name_list(self.object_names)}"

    @property
    def num_paths(self) -> int:
        return self.a.shape[2]

    @property
    def velocity(self) -> FloatArray:
        """(path, time) radial velocity, half the rate of the path length [m/s]; positive is receding."""
        return 0.5 * SPEED_OF_LIGHT * self.tau_rate.mean(axis=(0, 1))

    @property
    def doppler(self) -> FloatArray:
        """(path, time) Doppler shift at `frequency` [Hz] in Sionna's sign: approaching is positive."""
        return -2.0 * self.velocity * self.frequency / SPEED_OF_LIGHT

    @property
    def range(self) -> FloatArray:
        """(path, time) half the path length, mean over the element pairs [m]."""
        return 0.5 * SPEED_OF_LIGHT * self.tau.mean(axis=(0, 1))

    def weights(self, t: FloatArray, derivative: int = 0) -> FloatArray:
        """(len(t), time) matrix from values at the knots to values (or derivatives) at times `t` [s]."""
        return knot_weights(self.times, t, derivative)

    def at(self, times: FloatArray) -> RadarPaths:
        """The same paths with other knots `times` (time,) [s], interpolated by the spline."""
        weights = self.weights(times)
        direction, arrival = (np.einsum("nk,pki->pni", weights, each) for each in (self.direction, self.arrival))
        return replace(
            self,
            a=self.a @ weights.T,
            tau=self.tau @ weights.T,
            tau_rate=self.tau @ self.weights(times, 1).T if len(self.times) > 1 else self.tau_rate @ weights.T,
            times=np.asarray(times, dtype=np.float64),
            direction=direction / np.linalg.norm(direction, axis=2, keepdims=True),
            arrival=arrival / np.linalg.norm(arrival, axis=2, keepdims=True),
            dispersion=None if self.dispersion is None else self.dispersion @ weights.T,
        )

    def select(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> RadarPaths:
        """Paths of the mask or indices `chosen` (path,)."""
        values: dict[str, Any] = {name: getattr(self, name)[:, :, chosen] for name in _CHANNEL_FIELDS}
        values |= {name: getattr(self, name)[chosen] for name in _PATH_FIELDS}
        dispersion = None if self.dispersion is None else self.dispersion[:, :, :, chosen]
        return replace(self, **values, dispersion=dispersion)

    @staticmethod
    def concatenate(parts: Sequence[RadarPaths]) -> RadarPaths:
        """All paths of `parts`, which must share knots, elements, names and band.

        Raises
        ------
        ValueError
            If `parts` is empty, or parts differ in knots, elements, names or band.
        """
        if not parts:
            raise ValueError("parts is empty: at least one set of paths is needed")
        first = parts[0]
        for part in parts[1:]:
            if not np.array_equal(part.times, first.times) or part.a.shape[:2] != first.a.shape[:2]:
                raise ValueError("parts differ in their knots or in their number of elements")
            if any(getattr(part, name) != getattr(first, name) for name in ("object_names", "part_names", "frequency")):
                raise ValueError("parts differ in their object names, part names or reference frequency")
        order = max(0 if part.dispersion is None else len(part.dispersion) for part in parts)
        bands = {part.half_band for part in parts if part.dispersion is not None}
        if len(bands) > 1:
            raise ValueError(f"parts differ in the band of their dispersion: {sorted(bands)} Hz")

        def dispersion() -> ComplexArray:
            count = sum(part.num_paths for part in parts)
            full, last = np.zeros((order, *first.a.shape[:2], count, first.a.shape[3]), dtype=np.complex128), 0
            for part in parts:
                if part.dispersion is not None:
                    full[: len(part.dispersion), :, :, last : last + part.num_paths] = part.dispersion
                last += part.num_paths
            return full

        def join(name: str, axis: int) -> Any:
            return np.concatenate([getattr(part, name) for part in parts], axis=axis)

        values = {name: join(name, 2) for name in _CHANNEL_FIELDS} | {name: join(name, 0) for name in _PATH_FIELDS}
        half_band = max(bands, default=0.0)
        return replace(first, **values, dispersion=dispersion() if order else None, half_band=half_band)

    def labels(self) -> list[dict[str, Any]]:
        """Ground truth, one record per path: object, part, kind, bounces, radial velocity [m/s] at the first knot."""
        columns = (self.object_id, self.part_id, self.kind, self.bounces, self.velocity[:, 0])
        return [
            {
                "object": self.object_names[o],
                "part": self.part_names[p],
                "kind": PathKind(int(k)).name.lower(),
                "bounces": int(b),
                "radial_velocity": float(v),
            }
            for o, p, k, b, v in zip(*columns, strict=True)
        ]


@dataclass(frozen=True, repr=False)
class Pir(ShortRepr):
    """Path-based intermediate representation: image of the returns at the radar's viewpoint, without hardware.

    Row 0 is the top, column 0 the left side from the radar. Pixels without returns have an `energy` of 0 and a
    `time_of_arrival` of NaN.
    """

    energy: FloatArray
    """(row, column) sum of |path gain|^2 for isotropic elements."""
    time_of_arrival: FloatArray
    """(row, column) energy-weighted round-trip delay [s]."""
    velocity: FloatArray
    """(row, column) energy-weighted radial velocity [m/s]; positive is receding."""
    fov_deg: tuple[float, float]
    """Horizontal and vertical field of view [degrees]."""
    position: tuple[float, float, float]
    """Viewpoint, world frame [m]."""
    orientation: tuple[float, float, float]
    """Yaw, pitch, roll of the viewpoint [rad], Sionna's convention."""
    projection: str = "perspective"
    """"perspective", or "equirectangular": columns are evenly spaced in azimuth and rows in elevation."""
    time: float = 0.0
    """[s]"""

    def _facts(self) -> Iterable[str]:
        rows, columns = np.shape(self.energy)
        seen = self.energy > 0
        yield f"{rows} × {columns} pixels"
        yield f"{self.fov_deg[0]:g}° × {self.fov_deg[1]:g}° {self.projection}"
        yield f"at {self.time:.4g} s from {short_vector(self.position)} m"
        yield f"{np.count_nonzero(seen)} pixels with returns"
        if seen.any():
            ranges = 0.5 * SPEED_OF_LIGHT * self.time_of_arrival[seen]
            yield f"at {ranges.min():.4g} … {ranges.max():.4g} m"


@dataclass(frozen=True, repr=False)
class AdcCube(ShortRepr):
    """Baseband samples of a run, with their radar."""

    data: NDArray[np.complex64] | NDArray[np.float32]
    """(frame, chirp, tx, rx, sample) in square roots of watts at the receiver input: |sample|^2 is power [W]. Samples
    of a real ADC are sqrt(2) times the real part, so that their mean square is power.

    `chirp` counts loops. `tx` counts Tx elements where they fire in turn (TDM), each at the time of its slot, in the
    order of `radar.tx_names`, not of firing (:meth:`in_firing_order`). Where several fire at once or chirps differ,
    `tx` counts the slots of a loop; `radar.axis_names` are its entries, and `processing.demultiplex` separates the Tx
    elements."""
    radar: Radar
    frame_times: FloatArray
    """(frame,) start of the first ramp of each frame [s]."""
    seed: int | None = None
    """Seed of the noise; None for a cube without noise."""

    def _facts(self) -> Iterable[str]:
        axes = ("frames", "loops", self.radar.axis_kind, "Rx", "samples")
        yield " × ".join(f"{length} {axis}" for length, axis in zip(self.data.shape, axes, strict=True))
        yield f"{self.data.dtype} [√W]"
        yield f"radar {self.radar.name!r} ({self.radar.preset})"
        yield time_span(self.frame_times)
        yield self.radar.cell_text
        yield "no noise seed" if self.seed is None else f"seed {self.seed}"

    def in_firing_order(self) -> tuple[NDArray[np.complex64] | NDArray[np.float32], tuple[str, ...]]:
        """Samples (frame, chirp, slot, rx, sample) in the order in which the slots of a loop fire, and their names.

        Programs that number Tx elements by slot take them so. A preset that fires TX1, TX3, TX2 has the entries TX1,
        TX2, TX3 in the cube:

        >>> from rfgen_sionna.radar import Radar
        >>> radar = Radar.load("awr1843", "mmmesh")
        >>> cube = AdcCube(np.zeros((1, *radar.frame_shape), np.complex64), radar, np.zeros(1))
        >>> samples, names = cube.in_firing_order()
        >>> radar.axis_names, names
        (('TX1', 'TX2', 'TX3'), ('TX1', 'TX3', 'TX2'))

        A cube whose entries are slots is unchanged.
        """
        order = list(self.radar.waveform.slot_axis)
        names = tuple(self.radar.axis_names[entry] for entry in order)
        return (self.data if order == sorted(order) else self.data[:, :, order]), names
