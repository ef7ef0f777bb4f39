"""Returns by two curved surfaces: body to body, limb to trunk, body to round furniture.

Curved surfaces reflect each other at specular double bounces, found at each sample time
(:mod:`~rfgen_sionna.tracing.curved.double_bounce_search`) and evaluated by geometrical optics with the spreading of
both curvatures. Between sample times each double bounce is moved with its surfaces from both sides: matching ones form
a track, others fade in or out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import PathKind, RadarPaths, interpolate_knots, knot_weights
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.curved.array_elements import ArrayElements, band_nodes, fit_over_band
from rfgen_sionna.tracing.curved.arriving_waves import ArrivingWave, CurvedRoute, polarised_field
from rfgen_sionna.tracing.curved.double_bounce_search import DoubleBounceSearch
from rfgen_sionna.tracing.curved.double_bounces import DoubleBounces, match_points
from rfgen_sionna.tracing.curved.media import SurfaceOptics
from rfgen_sionna.tracing.curved.smoothed_surface import SmoothedSurface, corner_curvatures
from rfgen_sionna.tracing.curved.stationary_phase_error import stationary_phase_errors
from rfgen_sionna.tracing.integral.propagation import phasors
from rfgen_sionna.tracing.surface.facets import RATE_STEP
from rfgen_sionna.tracing.surface.surfaces import Surface, Surfaces

Positions = Callable[[float], Sequence[FloatArray]]
OMITTED_SHARE = 0.5
"""Share of the tolerance below which the double bounces of a surface are left out."""
TRACK_WAVELENGTHS = 1 / 16
"""Most difference of path length half way between sample times within one track [wavelengths]."""
TRACK_DISTANCE = 0.05
"""Most distance of their points there [m]."""


@dataclass(frozen=True)
class DoubleBounceVisibility:
    """Double bounces at a sample time."""

    double_bounces: DoubleBounces
    stationary_phase_error: FloatArray
    """(double bounce,) relative error of each (:mod:`~rfgen_sionna.tracing.curved.stationary_phase_error`)."""
    sampled_facets: int
    """Candidate faces."""
    rays: int


@dataclass(frozen=True)
class _Tracks:
    """Double bounces over several sample times."""

    first: NDArray[np.intp]
    """(track,) first sample time of each."""
    last: NDArray[np.intp]
    """(track,) last one."""
    entry: NDArray[np.intp]
    """(track, sample time) number of the double bounce, -1 outside the track."""


def _hat_weight(sample_times: FloatArray, k: int, t: float) -> float:
    """Linear weight of sample time `k` at `t`; constant beyond the first and the last one."""
    values = np.zeros(len(sample_times))
    values[k] = 1.0
    return float(np.interp(t, sample_times, values))


class CurvedReflections:
    """Finds and traces specular double bounces, interval by interval.

    Parameters
    ----------
    surfaces, radar
        Scene and radar.
    rtol
        Tolerance, relative to the direct return of the stronger of the two surfaces.
    reflectors
        Returns (face,) planar reflector of each face, -1 for none; called at first use.
    unoccluded
        Returns visible static faces without actors; called at first use.
    still
        True finds double bounces between static surfaces, False those with a moving one.
    """

    def __init__(
        self,
        surfaces: Surfaces,
        radar: Radar,
        rtol: float,
        reflectors: Callable[[], IntArray],
        unoccluded: Callable[[], NDArray[np.int64]],
        still: bool = False,
    ) -> None:
        self._surfaces, self._radar, self._rtol = surfaces, radar, rtol
        self._reflectors, self._visible_static = reflectors, unoccluded
        self._every: tuple[Surface, ...] = (*surfaces.static, *surfaces.moving)
        self._elements = ArrayElements.of(radar)
        self._half_band = 0.5 * radar.waveform.bandwidth
        self._optics = SurfaceOptics.of(
            [each.material for each in self._every], radar.center_frequency, self._half_band
        )
        self._whose = np.repeat(np.arange(len(self._every)), [len(each.faces) for each in self._every]).astype(np.int32)
        self._still = np.array([each.still for each in self._every], np.bool_)[self._whose]
        self._static_faces = sum(len(each.faces) for each in surfaces.static)
        # (face,) one of these has to be among both; seen from a radar that moves all are.
        self._required = (np.arange(len(self._whose)) < self._static_faces) == still
        self._recent_surfaces: list[SmoothedSurface] = []

    def trace_visibility(
        self, rays: RayScene, vertices: Sequence[FloatArray], visible: IntArray
    ) -> DoubleBounceVisibility:
        """Double bounces with all surfaces at `vertices` [m]; `visible` are the directly visible moving faces."""
        surface_model = self._smoothed(vertices)
        bent = (self._reflectors() < 0) & ~surface_model.plane[surface_model.sheet]
        wanted = np.zeros(len(bent), np.bool_)
        for some in (self._visible_static(), visible):
            wanted[some] = bent[some]
        if not (wanted & self._required).any():
            return DoubleBounceVisibility(DoubleBounces.none(), np.zeros(0), 0, 0)
        source, limits = self._elements.position, (self._radar.max_range, self._radar.wavelength)
        given = surface_model, rays, source, wanted, *limits, self._required
        search = DoubleBounceSearch(*given, lambda facet: self._curvatures(surface_model, facet))
        found = search.find()
        error = stationary_phase_errors(found, self._middle(found), source, 2 * np.pi / self._radar.wavelength, rays)
        return DoubleBounceVisibility(found, error, int(wanted.sum()), search.sent)

    def trace(
        self,
        knots: FloatArray,
        sample_times: FloatArray,
        visible: Sequence[DoubleBounceVisibility],
        positions: Positions,
        reference_level: FloatArray,
    ) -> tuple[RadarPaths | None, float]:
        """Paths of the double bounces `visible` at each of the `sample_times` [s], with delays at `knots` [s]; None
        where all are below the tolerance. Also the largest error of a surface, relative to its `reference_level`
        (moving surface,), or (1,) for the static scene: geometrical optics and what is left out."""
        found, worst = self.strong(visible, reference_level)
        if not any(len(each) for each in found):
            return None, worst
        return self.paths(knots, sample_times, found, positions), worst

    def strong(
        self, visible: Sequence[DoubleBounceVisibility], reference_level: FloatArray
    ) -> tuple[list[DoubleBounces], float]:
        """Double bounces above the tolerance at each sample time, and the error, as of :meth:`trace`."""
        most = self._reference_levels(reference_level)
        found = [each.double_bounces for each in visible]
        level, off = np.max(
            [self._levels(each.double_bounces, most, each.stationary_phase_error) for each in visible], axis=0
        )
        strong = level > OMITTED_SHARE * self._rtol * most
        error = np.where(strong, off, level) / np.where(most > 0, most, np.inf)
        found = [each.take(np.flatnonzero(strong[self._stronger(each, most)])) for each in found]
        return found, float(error.max(initial=0.0))

    def _smoothed(self, vertices: Sequence[FloatArray]) -> SmoothedSurface:
        if not self._recent_surfaces:
            self._recent_surfaces = [
                SmoothedSurface.one(each, points) for each, points in zip(self._every, vertices, strict=True)
            ]
            return SmoothedSurface.joined(self._recent_surfaces)
        first = len(self._surfaces.static)
        moved = zip(self._every[first:], vertices[first:], self._recent_surfaces[first:], strict=True)
        return SmoothedSurface.joined([*self._recent_surfaces[:first], *(SmoothedSurface.one(*each) for each in moved)])

    def _curvatures(self, surface_model: SmoothedSurface, facet: NDArray[np.int64]) -> FloatArray:
        """(n, 3, 3, 3) change of normals at the corners of faces `facet` (n,) of the ray scene [1/m]."""
        found = np.zeros((len(facet), 3, 3, 3))
        for number in np.unique(self._whose[facet]).tolist():
            lane, own = np.flatnonzero(self._whose[facet] == number), self._every[number]
            first, last = own.first_facet, own.first_facet + len(own.faces)
            stands = surface_model.corners[first:last], surface_model.normals[first:last]
            found[lane] = corner_curvatures(own, *stands, facet[lane] - first)
        return found

    def _reference_levels(self, reference_level: FloatArray) -> FloatArray:
        """(surface,) direct returns that errors are relative to; of surfaces at rest in the world the strongest."""
        count, first = len(self._every), len(self._surfaces.static)
        found = np.zeros(count)
        found[first:] = reference_level if first < count else found[first:]
        still = np.array([each.still for each in self._every], np.bool_)
        found[still] = reference_level.max(initial=0.0) if first == count else found[still].max(initial=0.0)
        return found

    def _stronger(self, double_bounces: DoubleBounces, reference_level: FloatArray) -> NDArray[np.intp]:
        """(double bounce,) surface of larger direct return."""
        of = self._whose[double_bounces.facet].astype(np.intp)
        return np.where(reference_level[of[:, 1]] > reference_level[of[:, 0]], of[:, 1], of[:, 0])

    def _levels(
        self, double_bounces: DoubleBounces, reference_level: FloatArray, stationary_phase_error: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """(surface,) returns of double bounces at the band's centre with element pattern, counted for the stronger
        surface, and their errors from the `stationary_phase_error` (double bounce,)."""
        found, off = np.zeros((2, len(self._every)))
        if len(double_bounces) == 0:
            return found, off
        elements, place = self._elements, self._elements.position
        arrival, route = double_bounces.arrival(self._whose, place, place, self._optics)
        a = self._received(arrival, route, self._radar.center_frequency) * self._caustic_factors(double_bounces)
        a = a * np.sqrt(elements.pattern_gain(arrival.legs[0]) * elements.pattern_gain(-arrival.ray))
        a = a * phasors(arrival.length / self._radar.wavelength)
        owner = self._stronger(double_bounces, reference_level)
        for number in np.unique(owner).tolist():
            lane = owner == number
            own = a[lane]
            found[number] = 2.0 * max(float(abs(own.sum())), float(np.linalg.norm(own)))
            off[number] = 2.0 * float(np.linalg.norm(own * stationary_phase_error[lane]))
        return found, off

    def _received(self, arrival: ArrivingWave, route: CurvedRoute, frequency: float) -> ComplexArray:
        """(double bounce,) gain without the propagation phase."""
        send, receive = self._elements.fields
        field = polarised_field(send, arrival, route, self._optics, frequency)
        across = receive - (arrival.ray @ receive)[:, None] * arrival.ray
        across /= np.maximum(lengths(across), 1e-9)[:, None]
        return np.asarray(SPEED_OF_LIGHT / (4 * np.pi * frequency) * np.einsum("gi,gi->g", field, across))

    def _middle(self, double_bounces: DoubleBounces) -> ArrivingWave:
        """Paths of the phase centre."""
        place = self._elements.position
        return double_bounces.arrival(self._whose, place, place, self._optics)[0]

    def _caustic_factors(self, double_bounces: DoubleBounces) -> FloatArray:
        return double_bounces.caustic_factor(self._middle(double_bounces), 2 * np.pi / self._radar.wavelength)

    def _at_time(
        self, double_bounces: DoubleBounces, t: float, positions: Positions
    ) -> tuple[DoubleBounces, ArrivingWave]:
        """Double bounces and paths moved to the time `t` [s]."""
        stand = [*self._surfaces.static_vertices, *positions(t)]
        there = double_bounces.transported(SmoothedSurface.some(self._every, stand, double_bounces.facet.T.reshape(-1)))
        return there, self._middle(there)

    def _tracks(self, sample_times: FloatArray, found: Sequence[DoubleBounces], positions: Positions) -> _Tracks:
        """Double bounces linked from sample time to sample time."""
        entry = [np.arange(len(found[0]))[:, None]]
        for k in range(1, len(found)):
            t = 0.5 * float(sample_times[k - 1] + sample_times[k])
            before, after = (self._at_time(each, t, positions) for each in found[k - 1 : k + 1])
            # Path lengths are scaled so that one distance bounds both.
            scale = TRACK_DISTANCE / (TRACK_WAVELENGTHS * self._radar.wavelength)
            places = [
                np.column_stack([there.point.reshape(-1, 6), scale * arrival.length])
                for there, arrival in (before, after)
            ]
            one, other = match_points(places[0], places[1], TRACK_DISTANCE)
            following = np.full(len(found[k - 1]) + 1, -1, np.intp)  # the last is for those that have ended
            following[one] = other
            past = entry[-1]
            held = following[past[:, -1]]
            fresh = np.setdiff1d(np.arange(len(found[k])), other)
            new = np.full((len(fresh), k), -1, np.intp)
            entry.append(np.concatenate([np.column_stack([past, held]), np.column_stack([new, fresh])]))
        there = entry[-1] >= 0
        first = np.argmax(there, axis=1)
        return _Tracks(first, first + there.sum(axis=1) - 1, entry[-1])

    def paths(
        self, knots: FloatArray, sample_times: FloatArray, found: Sequence[DoubleBounces], positions: Positions
    ) -> RadarPaths:
        """Paths of the double bounces `found` at the `sample_times` [s], as of :meth:`trace`: all in one direction,
        then in the other."""
        tracks, elements = self._tracks(sample_times, found, positions), self._elements
        count = len(tracks.first)
        late = self._optics.table.round_trip_lengths
        echoes = max(float(late[self._whose[each.facet]].sum(axis=1).max(initial=0.0)) for each in found)
        u = band_nodes(echoes, self._half_band, self._rtol)
        shape = len(elements.tx), len(elements.rx), 2 * count
        gains = np.zeros((len(u), *shape, len(sample_times)), np.complex128)
        extra = np.zeros(
            (*shape, len(sample_times))
        )  # by how much ways of element pairs differ from the phase centre's
        for k, each in enumerate(found):
            lane = np.flatnonzero(tracks.entry[:, k] >= 0)
            a, way = self._of_pairs(each.take(tracks.entry[lane, k]), u)
            column = np.concatenate([lane, lane + count])
            gains[..., column, k], extra[..., column, k] = a, way
        for k in range(len(sample_times)):  # constant before a track begins and after it ends
            near = np.tile(np.clip(k, tracks.first, tracks.last), 2)
            off = np.flatnonzero(near != k)
            extra[..., off, k] = extra[..., off, near[off]]
        way, first, last = self._at_knots(knots, sample_times, found, tracks, positions)
        if not np.array_equal(knots, sample_times):
            weights = knot_weights(sample_times, knots)
            gains, extra = interpolate_knots(weights, gains), extra @ weights.T
        tau = (np.tile(way, (2, 1)) + extra) / SPEED_OF_LIGHT
        if len(knots) > 1:
            rate = tau @ knot_weights(knots, knots, 1).T
        else:
            known = sample_times, found, tracks, positions
            before, after = (self._at_knots(knots + step, *known)[0] for step in (-RATE_STEP, RATE_STEP))
            slope = (after - before) / (2 * RATE_STEP * SPEED_OF_LIGHT)
            rate = np.broadcast_to(np.tile(slope, (2, 1)), tau.shape).copy()
        return self._labelled(found, tracks, knots, gains, tau, rate, first, last)

    def _of_pairs(self, double_bounces: DoubleBounces, u: FloatArray) -> tuple[ComplexArray, FloatArray]:
        """Gains (order, tx, rx, path) of all element pairs and the excess (tx, rx, path) [m] of their path lengths over
        the phase centre's; all double bounces in one direction, then in the other."""
        elements, count = self._elements, len(double_bounces)
        shape = len(elements.tx), len(elements.rx), 2 * count
        both = DoubleBounces.concatenate([double_bounces, double_bounces.reverse()]).take(
            np.tile(np.arange(2 * count), shape[0] * shape[1])
        )
        tx = np.broadcast_to(elements.tx[:, None, None], (*shape, 3)).reshape(-1, 3)
        rx = np.broadcast_to(elements.rx[None, :, None], (*shape, 3)).reshape(-1, 3)
        arrival, route = both.arrival(self._whose, tx, rx, self._optics)
        frequencies = [self._radar.center_frequency + self._half_band * float(each) for each in u]
        gains = np.stack([self._received(arrival, route, each).reshape(shape) for each in frequencies])
        gains = gains * np.tile(self._caustic_factors(double_bounces), 2)
        return fit_over_band(u, gains), arrival.length.reshape(shape) - np.tile(self._middle(double_bounces).length, 2)

    def _at_knots(
        self,
        knots: FloatArray,
        sample_times: FloatArray,
        found: Sequence[DoubleBounces],
        tracks: _Tracks,
        positions: Positions,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Path lengths (track, knot) [m] and directions (track, knot, 3) to the first and the second point. Blended
        linearly between sample times, extrapolated linearly outside the track."""
        shape = len(tracks.first), len(knots)
        way, ends = np.zeros(shape), np.zeros((2, *shape, 3))
        for k, double_bounces in enumerate(found):
            whole, at = self._middle(double_bounces), float(sample_times[k])
            near = np.clip(k, tracks.first, tracks.last) == k
            overshoot = np.flatnonzero(near & ((tracks.first == k) | (tracks.last == k)))
            slope = np.zeros(len(double_bounces))
            if len(overshoot) and len(sample_times) > 1:
                chosen = double_bounces.take(tracks.entry[overshoot, k])
                before, after = (
                    self._at_time(chosen, at + step, positions)[1].length for step in (-RATE_STEP, RATE_STEP)
                )
                slope[tracks.entry[overshoot, k]] = (after - before) / (2 * RATE_STEP)
            for j, t in enumerate(knots.tolist()):
                weight = _hat_weight(sample_times, k, t)
                # The first and last sample time of a track stand for those outside.
                share = sum(
                    (_hat_weight(sample_times, other, t) * (np.clip(other, tracks.first, tracks.last) == k)
                     for other in range(len(sample_times))), np.zeros(shape[0]),
                )  # fmt: skip
                lane = np.flatnonzero(share > 0)
                if len(lane) == 0:
                    continue
                entry = tracks.entry[lane, k]
                if weight > 0 and t != at:
                    arrival = self._at_time(double_bounces.take(entry), t, positions)[1]
                    length, legs = arrival.length, (arrival.legs[0], -arrival.ray)
                else:
                    length = whole.length[entry] + (t - at) * slope[entry]
                    legs = whole.legs[0][entry], -whole.ray[entry]
                way[lane, j] += share[lane] * length
                for end, towards in enumerate(legs):
                    ends[end, lane, j] += share[lane, None] * towards
        ends /= np.maximum(np.linalg.norm(ends, axis=-1, keepdims=True), 1e-12)
        return way, ends[0], ends[1]

    def _labelled(
        self,
        found: Sequence[DoubleBounces],
        tracks: _Tracks,
        knots: FloatArray,
        gains: ComplexArray,
        tau: FloatArray,
        rate: FloatArray,
        first: FloatArray,
        last: FloatArray,
    ) -> RadarPaths:
        """The paths; each is of the surface that it returns from, or of the other one where that is at rest in the
        world."""
        places = [found[k].facet[tracks.entry[n, k]] for n, k in enumerate(tracks.first.tolist())]
        pairs = np.array(places, np.int64).reshape(-1, 2)
        facet = np.concatenate([pairs[:, 1], pairs[:, 0]])
        facet = np.where(self._still[facet], np.concatenate([pairs[:, 0], pairs[:, 1]]), facet)
        surface = self._whose[facet]
        face = (facet - np.array([each.first_facet for each in self._every])[surface]).astype(np.int32)
        part = np.zeros(len(face), np.int32)
        for number in np.unique(surface).tolist():
            own = surface == number
            part[own] = self._every[number].parts[face[own]]
        several = len(gains) > 1
        return RadarPaths(
            a=gains[0], tau=tau, tau_rate=rate, times=knots, frequency=self._radar.center_frequency,
            direction=np.concatenate([first, last]), arrival=np.concatenate([last, first]),
            object_id=np.array([each.object_id for each in self._every], np.int32)[surface], part_id=part,
            kind=np.full(len(face), PathKind.MULTI_BOUNCE, np.uint8), bounces=np.full(len(face), 2, np.uint8),
            object_names=self._surfaces.object_names, part_names=self._surfaces.part_names, facet=face,
            dispersion=gains[1:] if several else None, half_band=self._half_band if several else 0.0,
        )  # fmt: skip
