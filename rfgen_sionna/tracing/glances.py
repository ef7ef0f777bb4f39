"""Glances between instants at facets that shadows' edges pass over.

Gains are splines through instants. Where the edge of a shadow moves over a facet, above all over a large one seen
aslant, its gain changes with the wavelengths that the edge passes and not with the turns of the body: in a walking
person a few facets of thousands, behind the arm that swings. By how much splines miss them between instants is told by
leaving each instant out in turn. Those that matter are looked at in between as well, and go by paths of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.records import ComplexArray, FloatArray, IntArray, knot_weights
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.knots import RIM_ERROR
from rfgen_sionna.tracing.sight import Seen, Sight
from rfgen_sionna.tracing.smooth import Bend

BETWEEN_PER_RTOL = 3.0
"""What a return may err by between instants for shadows that move on, relative to itself [root mean square over time],
per unit of the tolerance: as much as for gains that turn with the body."""
MOST = 8
"""Times from one instant to the next, at most."""
_EACH = 0.7
"""Share of that which facets that are looked at in between may err by, and the others."""
_SMOOTH = 1 / 8
"""What splines through all instants miss of gains that change smoothly, against those that leave one out, and twice
that for safety: the error goes with the fourth power of the gap. Where an edge passes it goes with the gap itself, so
that twice the error is what was missed."""
_FEWEST = 4
"""Instants that tell anything."""


class Chosen(NamedTuple):
    """Facets to be looked at between instants."""

    facets: NDArray[np.intp]
    """(chosen,) ascending."""
    rounds: int
    """Times from one instant to the next."""
    rest: FloatArray
    """(surface,) estimated error of all others between instants."""
    level: FloatArray
    """(surface,) return that errors are relative to."""

    def error(self, gains: ComplexArray, surface: NDArray[np.integer[Any]]) -> float:
        """Estimated relative error between times of the worst surface, where those chosen, of the `surface` (chosen,),
        have the `gains` (chosen, time)."""
        energy = self.rest**2 + np.bincount(surface, _largest(left_out(gains)), len(self.rest))
        return float(np.sqrt(energy / np.where(self.level > 0, self.level, np.inf) ** 2).max(initial=0.0))


def left_out(gains: ComplexArray) -> ComplexArray:
    """(facet, inner time) by how much `gains` (facet, time) at evenly spaced times differ from the cubics through their
    four neighbours."""
    count = gains.shape[1]
    weights = np.zeros((max(count - 2, 0), count))
    for k, row in enumerate(weights, 1):
        first = min(max(k - 2, 0), max(count - 5, 0))
        others = [m for m in range(first, min(first + 5, count)) if m != k]
        for m in others:
            row[m] = -np.prod([(k - other) / (m - other) for other in others if other != m])
        row[k] = 1.0
    return np.asarray(gains @ weights.T)


def _largest(missed: ComplexArray) -> FloatArray:
    """(facet,) largest energy of what is `missed` (facet, time): by chance it is little at one time or another."""
    return np.asarray((missed.real**2 + missed.imag**2).max(axis=1, initial=0.0))


def _lost(swing: FloatArray) -> FloatArray:
    """(facet,) share of the energy of phasors that swing by so much [rad] from time to time that splines miss."""
    return np.asarray(np.minimum(RIM_ERROR * swing**4, 1.0) ** 2)


def _rms(parts: ComplexArray) -> FloatArray:
    """(part,) root mean squares over time of `parts` (part, time)."""
    return np.asarray(np.sqrt((parts.real**2 + parts.imag**2).mean(axis=1)))


def choose(
    gains: ComplexArray,
    phasors: ComplexArray,
    shares: FloatArray,
    width: FloatArray,
    steady: NDArray[np.bool_],
    surface: NDArray[np.integer[Any]],
    usual: FloatArray,
    rtol: float,
) -> Chosen:
    """Choose facets that splines through the instants miss most of, where all together is more than the tolerance.

    Parameters
    ----------
    gains, phasors
        (facet, instant) of one pair at one frequency, antennas included, and of the propagation, at evenly spaced
        instants.
    shares
        (facet, instant) of the area that is seen.
    width
        (facet,) phase between the ends of each facet, both ways [rad].
    steady
        (facet,) whether a facet faces the radar all the time; others are not chosen.
    surface
        (facet,) position in the list of surfaces.
    usual
        (surface,) what each surface's return counts as at least.
    rtol
        Relative tolerance.
    """
    chosen, rounds, rest, level = [np.zeros(0, np.intp)], 1, np.zeros(len(usual)), usual.copy()
    if gains.shape[1] < _FEWEST:
        return Chosen(chosen[0], rounds, rest, level)
    edged = ((shares > 0) & (shares < 1)).any(axis=1) | (np.ptp(shares, axis=1) > 0)
    missed = np.where(edged, 1.0, _SMOOTH)[:, None] * left_out(gains)
    # An edge that moves on by a wavelength from one instant to the next may seem to rest.
    swing = width * np.abs(np.diff(shares)).max(axis=1)
    seen = np.where(edged, _largest(gains), 0.0)
    energy, missed = np.maximum(_largest(missed), seen * _lost(swing)), missed * phasors[:, 1:-1]
    for number in range(len(usual)):
        mine = np.flatnonzero(surface == number)
        returned = float(_rms((gains[mine] * phasors[mine]).sum(axis=0)[None])[0])
        level[number] = max(returned, level[number])
        allowed = BETWEEN_PER_RTOL * rtol * level[number]
        able = mine[(edged & steady)[mine]]
        able = able[np.argsort(-energy[able], kind="stable")]
        # What the others miss when the first so many are followed: one by one, and as they add up, side by side.
        apart, together = np.zeros(len(able) + 1), np.zeros((len(able) + 1, missed.shape[1]), np.complex128)
        np.cumsum(energy[able], out=apart[1:])
        np.cumsum(missed[able], axis=0, out=together[1:])
        others = np.sqrt(np.maximum(energy[mine].sum() - apart, 0.0))
        others = np.maximum(others, _rms(missed[mine].sum(axis=0) - together))
        count = 0
        if others[0] > allowed > 0:
            enough = np.maximum.accumulate(others[::-1])[::-1] <= _EACH * allowed
            count = int(enough.argmax()) if enough.any() else len(able)
            chosen.append(followed := able[:count])
            while rounds < MOST and (seen * _lost(swing / rounds))[followed].sum() > (_EACH * allowed) ** 2:
                rounds += 1
        rest[number] = others[count]
    return Chosen(np.sort(np.concatenate(chosen)), rounds, rest, level)


def look(
    sight: Sight,
    chosen: NDArray[np.intp],
    places: IntArray,
    instants: FloatArray,
    seen: Sequence[Seen],
    times: FloatArray,
    known: dict[float, Seen],
    corners: Callable[[float], FloatArray],
    rays: Callable[[float], RayScene],
) -> list[Seen]:
    """What is seen at `times` [s] of the facets `chosen` of all those `seen` at the `instants` [s]; they face the radar
    all the time.

    `places` (facet, 3) are those of :func:`rfgen_sionna.tracing.sampling.touching`, of all facets; `known` keeps what
    is found from one call to the next; `corners` and `rays` give the corners (chosen, 3, 3) [m] and the ray scene at a
    time.
    """
    if not known:
        known.update((float(t), each.of(chosen)) for t, each in zip(instants, seen, strict=True))
    at_instants = [known[float(t)] for t in instants]
    outline = np.max([each.outline for each in at_instants], axis=0)
    level = np.min([each.level for each in seen], axis=0)
    bends = [each.facets.bend for each in at_instants if each.facets.bend is not None]
    for t, weights in zip(times.tolist(), knot_weights(instants, times), strict=True):
        if t not in known:
            facets = replace(at_instants[0].facets, corners=corners(t), bend=Bend.blended(bends, weights))
            known[t] = sight.glance(rays(t), facets, places[chosen], outline, level)
    return [known[t] for t in times.tolist()]


def fine_times(instants: FloatArray, rounds: int) -> FloatArray:
    """(time,) `rounds` of them from each of the evenly spaced `instants` [s] to the next, which are among them."""
    times = np.linspace(instants[0], instants[-1], rounds * (len(instants) - 1) + 1)
    times[::rounds] = instants
    return times
