"""Returns of moving facets at the sample times, with the shadow weight applied.

The shadow weight of a facet is its visible fraction: :meth:`FacetReturns.apply_visibility` multiplies the integral of
the whole facet by it, or integrates the visible pieces of a partly occluded facet.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from rfgen_sionna._types import ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.kernels import concatenate_aligned
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.gains.expansion import PROBES, Expansion
from rfgen_sionna.tracing.integral.propagation import phasors
from rfgen_sionna.tracing.moving.visible_facets import PerElementVisibility, VisibleFacets
from rfgen_sionna.tracing.shadows.boundary_edges import BoundaryCorrection
from rfgen_sionna.tracing.surface.facets import CANCELLED, Facets, sum_by_surface

AT_ONCE = 200_000
"""Facets per kernel launch, which bounds the memory."""
MIN_INCREASE = 0.2
"""Growth of a surface's visible area over that at the middle time above which another sample time gives its reference
level; bodies that shadow themselves change less."""


class SampledReturns(NamedTuple):
    """Returns of facets at sample times."""

    whole: list[ComplexArray]
    """(value, facet) at full visibility."""
    values: list[ComplexArray]
    """(value, facet) with the shadow weight, from the phase centre."""
    boundary_correction: list[BoundaryCorrection | None]
    """Differences of the element pairs, at each time; None without shadow boundaries."""
    missed: FloatArray
    """(surface,) estimated error of the correction, relative to the largest incoherent sum over time."""


def relative_to_largest(missed: FloatArray, level: FloatArray, best: FloatArray) -> FloatArray:
    """(surface,) largest error over time: `missed` (time, surface) relative to `level` (time, surface), as share of
    `best` (surface,)."""
    return np.asarray((missed * level).max(axis=0) / np.where(best > 0, best, np.inf))


class FacetReturns:
    """Integrates facets of surfaces with `materials`. In the methods, `references` are the points (facet, 3) [m] of the
    delays, one array per time. Surfaces of one `tolerance_group` (surface,) share a tolerance."""

    def __init__(self, band: BandTracer, materials: tuple[Material, ...], tolerance_group: IntArray) -> None:
        self._band, self._materials, self._tolerance_group = band, materials, tolerance_group

    def values(
        self, parts: Sequence[Facets], expansion: Expansion, references: Sequence[FloatArray]
    ) -> list[ComplexArray]:
        """(value, facet) of each of `parts` at full visibility; integrated together, as a kernel launch costs as much
        as ten thousand facets."""
        found: list[ComplexArray] = []
        batch = np.cumsum([len(each) for each in parts]) // AT_ONCE
        for number in np.unique(batch):
            first, last = np.searchsorted(batch, [number, number + 1])
            some, reference = parts[first:last], concatenate_aligned(references[first:last])
            values = self._band.values(Facets.joined(some), self._materials, expansion, reference)
            found += np.split(values, np.cumsum([len(each) for each in some])[:-1], axis=1)
        return found

    def apply_visibility(
        self,
        visible: Sequence[VisibleFacets],
        selected: NDArray[np.intp],
        facets: Sequence[Facets],
        references: Sequence[FloatArray],
        expansion: Expansion,
        times: int = 1,
    ) -> SampledReturns:
        """Returns with the shadow weight: the whole times its visible fraction, and piece by piece of partly occluded
        facets, each piece with its own phase. `facets` are those with indices `selected`, at each time, with
        `references`; each of `visible` may hold several `times` in succession."""
        cut = [number for number, each in enumerate(visible) if len(each.owner)]
        parts, theirs, missed = list(facets), list(references), np.zeros(len(self._materials))
        if cut:
            # The facets of all times are cut in one kernel.
            owners = [np.unique(visible[number].owner, return_inverse=True) for number in cut]
            first = np.cumsum([0, *(len(owner) for owner, _ in owners)])
            parents = Facets.joined([visible[n].facets.take(owner) for n, (owner, _) in zip(cut, owners, strict=True)])
            place = np.concatenate([index + start for (_, index), start in zip(owners, first[:-1], strict=True)])
            pieces = np.concatenate([visible[n].pieces for n in cut])
            occluder = np.concatenate([visible[n].occluder for n in cut])
            surfaces = len(self._materials)
            of = np.repeat(np.arange(len(cut)), [len(visible[n].owner) for n in cut])
            group = surfaces * of + self._tolerance_group[parents.surface[place]]
            level = np.stack([visible[n].level for n in cut])
            edges, of_cut = self._band.edges(parents, place, pieces, occluder, group, np.sqrt(times) * level.ravel())
            best = np.max([each.level for each in visible], axis=0)
            missed = relative_to_largest(of_cut.reshape(level.shape)[:, self._tolerance_group], level, best)
            parts.append(parents.cut(np.append(place, edges.owner), np.concatenate([pieces, edges.small_piece])))
            own = np.concatenate(
                [references[n][np.searchsorted(selected, owner)] for n, (owner, _) in zip(cut, owners, strict=True)]
            )
            theirs.append(np.concatenate([own[place], edges.middle + self._band.viewpoint]))
        found = self.values(parts, expansion, theirs)
        whole = found[: len(facets)]
        # Shadow weight: the visible fraction of each facet.
        sampled_returns = [own * each.fraction[selected] for own, each in zip(whole, visible, strict=True)]
        boundary_correction: list[BoundaryCorrection | None] = [None for _ in visible]
        if cut:
            starts = np.flatnonzero(np.diff(place, prepend=-1))
            of_facets = np.split(np.add.reduceat(found[-1][:, : len(place)], starts, axis=1), first[1:-1], axis=1)
            every = self._band.boundary_correction(edges, found[-1][:, len(place) :], own[edges.owner], expansion)
            for n, (owner, _), of_pieces, start in zip(cut, owners, of_facets, first.tolist(), strict=False):
                at = np.searchsorted(selected, owner)
                sampled_returns[n][:, at] = of_pieces
                there = every.take(slice(*np.searchsorted(edges.owner, [start, start + len(owner)])))
                boundary_correction[n] = there._replace(owner=at[there.owner - start])
        for n, each in enumerate(visible):
            if each.per_element is not None:
                given = facets[n], references[n], whole[n], sampled_returns[n], expansion
                more = self._per_element_correction(each.per_element.of(selected), *given)
                correction = boundary_correction[n]
                boundary_correction[n] = more if correction is None else BoundaryCorrection.joined([correction, more])
        return SampledReturns(whole, sampled_returns, boundary_correction, missed)

    def _per_element_correction(
        self,
        own: PerElementVisibility,
        facets: Facets,
        references: FloatArray,
        whole: ComplexArray,
        sampled_returns: ComplexArray,
        expansion: Expansion,
    ) -> BoundaryCorrection:
        """Difference of the pairs' returns by per-element visibility `own` from `sampled_returns` (value, facet) of the
        phase centre; `whole` (value, facet) at full visibility."""
        changed, at = np.unique(own.facet, return_inverse=True)
        weights = expansion.weights.reshape(expansion.order, -1, len(whole))
        gains = np.zeros((*weights.shape[:2], len(changed)), np.complex128)
        for pair in np.unique(own.pair):
            lane = np.flatnonzero(own.pair == pair)
            facet = own.facet[lane]
            values = whole[:, facet] * own.fraction[lane]
            place = np.full(len(own.facet), -1, np.intp)
            place[lane] = np.arange(len(lane))
            piece = np.flatnonzero(place[own.owner] >= 0)
            if len(piece):
                of, parent = place[own.owner[piece]], own.facet[own.owner[piece]]
                given = [facets.cut(parent, own.pieces[piece])], expansion, [references[parent]]
                starts = np.flatnonzero(np.diff(of, prepend=-1))
                values[:, of[starts]] = np.add.reduceat(self.values(*given)[0], starts, axis=1)
            gains[:, pair, at.reshape(-1)[lane]] = weights[:, pair] @ (values - sampled_returns[:, facet])
        return BoundaryCorrection(changed, gains.reshape(*expansion.weights.shape[:3], len(changed)))

    def pair_correction(
        self,
        boundary_correction: BoundaryCorrection | None,
        visible: VisibleFacets,
        selected: NDArray[np.intp],
        reference: FloatArray,
        pair: tuple[int, int],
        surfaces: NDArray[np.bool_],
        place: float = 0.0,
    ) -> ComplexArray:
        """(group,) difference of the return of a `pair` (Tx, Rx) from that of the phase centre, of some `surfaces`
        (surface,), at a `place` -1 … 1 of the band. `boundary_correction` is that of the `selected` facets with points
        `reference` (facet, 3) [m]; None returns 0."""
        count = len(self._materials)
        if boundary_correction is None:
            return np.zeros(count, np.complex128)
        whose = visible.facets.surface[selected[boundary_correction.owner]]
        mine = np.flatnonzero(surfaces[whose])
        owner, gains = boundary_correction.owner[mine], boundary_correction.gains[:, *pair, mine]
        waves = _gains_at(gains, place) * self._waves(reference[owner], pair, place) * visible.weight[selected[owner]]
        return sum_by_surface(waves[None], self._tolerance_group[whose[mine]], count)[0]

    def _waves(self, reference: FloatArray, pair: tuple[int, int], place: float = 0.0) -> ComplexArray:
        """(facet,) propagation phasors at a `place` -1 … 1 of the band."""
        frequency = self._band.frequency(np.array([place]))[0]
        return phasors(frequency * self._band.delays(reference, pair))

    def element_pair_returns(
        self,
        visible: VisibleFacets,
        surfaces: NDArray[np.bool_],
        pairs: Sequence[tuple[int, int]],
        expansion: Expansion,
    ) -> list[tuple[ComplexArray, FloatArray]]:
        """For each of the `pairs` (group,) difference from the phase centre by per-element visibility of some
        `surfaces` (surface,), in the middle of the band, and root mean square over the band of the pair's return."""
        there = visible.of(np.flatnonzero(visible.any_visible() & surfaces[visible.facets.surface]))
        selected, count = np.arange(len(there.facets)), len(self._materials)
        reference, tolerance_group = there.facets.centroids, self._tolerance_group[there.facets.surface]
        sampled_returns = self.apply_visibility([there], selected, [there.facets], [reference], expansion)
        found = []
        for pair in pairs:
            given = sampled_returns.boundary_correction[0], there, selected, reference, pair, surfaces
            gains, energy = expansion.weights[:, *pair] @ sampled_returns.values[0], np.zeros(count)
            for place in PROBES.tolist():
                waves = _gains_at(gains, place) * self._waves(reference, pair, place) * there.weight
                energy += (
                    np.abs(self.pair_correction(*given, place) + sum_by_surface(waves[None], tolerance_group, count)[0])
                    ** 2
                )
            found.append((self.pair_correction(*given), np.sqrt(energy / len(PROBES))))
        return found

    def coefficients(
        self,
        facets: Sequence[Facets],
        shares: FloatArray,
        values: Sequence[ComplexArray],
        expansion: Expansion,
        cluster_head: NDArray[np.intp],
        boundary_correction: Sequence[BoundaryCorrection | None],
        pattern: Sequence[FloatArray] | None = None,
    ) -> tuple[ComplexArray, NDArray[np.intp]]:
        """(order, tx, rx, path, time) of the paths, one per cluster, and the (path,) cluster heads.

        `facets` and their `values` (value, facet), shadow weight applied, are those of each time, as are the
        `boundary_correction` and `pattern` (facet,), the pattern gain over that of the head; None is 1. `shares`
        (facet, time) are visible fractions, which weight the energy of diffuse returns; `cluster_head` is (facet,).
        """
        order = np.argsort(cluster_head, kind="stable")
        heads, first = np.unique(cluster_head[order], return_index=True)
        if len(heads) == len(cluster_head):
            gathered = (
                values if np.array_equal(heads, cluster_head) else [np.take(each, order, axis=1) for each in values]
            )
            if pattern is not None:
                gathered = [each * gain[order] for each, gain in zip(gathered, pattern, strict=True)]
            of_paths = np.stack(gathered, axis=-1)
        else:
            of_paths = np.empty((len(values[0]), len(heads), len(values)), np.complex128)
            ends = np.append(first, len(order))
            for k, each in enumerate(values):
                weights = np.ones(len(order)) if pattern is None else pattern[k][order]
                rows = csr_array((weights, order, ends), shape=(len(heads), len(order)))
                # Real matrix times complex columns, as two real products.
                columns = np.ascontiguousarray(each.T).view(np.float64)
                of_paths[:, :, k] = np.asarray(rows @ columns).view(np.complex128).T
        found = self._band.combined(expansion, of_paths)
        path = np.searchsorted(heads, cluster_head)
        for k, correction in enumerate(boundary_correction):
            if correction is not None:
                weight = 1.0 if pattern is None else pattern[k][correction.owner]
                BoundaryCorrection(path[correction.owner], correction.gains * weight).add_to(found[..., k])
        for k, there in enumerate(facets):
            if (rough := self._band.diffuse(there, self._materials)) is not None:  # each facet has its own phase
                rough *= np.sqrt(shares[:, k])  # the energy is proportional to the visible area
                if there.outward is not None:  # grazing
                    rough[..., there.outward] = 0.0
                found[0, ..., k] += np.add.reduceat(rough[..., order], first, axis=-1)
        return found, heads

    def cancellation(
        self, by_way: Sequence[FloatArray], gains: ComplexArray, surface: IntArray, surfaces: int
    ) -> FloatArray:
        """(surface,) incoherent over coherent sum of each surface's paths over all times; 0 without a return. `by_way`
        are the (path, 3) points of the delays [m] at each time, `gains` (path, time) those of the first pair, `surface`
        (path,) one of `surfaces`."""
        alone, together = np.zeros((2, surfaces))
        surface = self._tolerance_group[surface]
        for own, there in zip(gains.T, by_way, strict=True):
            waves = own * phasors(self._band.centre * self._band.delays(there, (0, 0)))
            real, imaginary = (np.bincount(surface, part, surfaces) for part in (waves.real, waves.imag))
            alone += np.bincount(surface, own.real**2 + own.imag**2, surfaces)
            together += real**2 + imaginary**2
        return np.asarray(np.sqrt(alone / np.where(together > 0, together, np.inf)))[self._tolerance_group]


def _gains_at(coefficients: ComplexArray, place: float) -> ComplexArray:
    """(facet,) gains with `coefficients` (order, facet) at a `place` -1 … 1 of the band."""
    return np.asarray(place ** np.arange(len(coefficients)) @ coefficients)


def most_visible_times(shares: FloatArray, surface: NDArray[np.integer[Any]], half: int) -> list[int]:
    """Sample times of largest visibility of the surfaces that are much more visible then than at the time `half`;
    `shares` (facet, time) are visible fractions, `surface` (facet,) the surface of each facet."""
    more = np.bincount(surface, shares.max(axis=1) - shares[:, half])
    fading = np.flatnonzero(more > MIN_INCREASE * np.bincount(surface, shares[:, half]))
    return sorted({int(shares[surface == number].sum(axis=0).argmax()) for number in fading.tolist()})


def best_visible_level(
    waves: Callable[[int], ComplexArray],
    shares: FloatArray,
    surface: NDArray[np.integer[Any]],
    half: int,
    level: FloatArray,
    cancellation: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """(surface,) reference `level` and `cancellation` of each surface, at the time of its best visibility. `waves`
    gives the returns (facet,) at a time, with propagation and antennas; the others are those of
    :func:`most_visible_times`. `level` grows to the return at the time `half` at least."""
    best, more = level, cancellation
    for k in [half, *most_visible_times(shares, surface, half)]:
        found = waves(k)
        single = found.real**2 + found.imag**2
        together = np.hypot(*(np.bincount(surface, part, len(level)) for part in (found.real, found.imag)))
        alone = np.sqrt(np.bincount(surface, single, len(level)))
        if k != half:
            strongest = np.zeros(len(level))
            np.maximum.at(strongest, surface, np.sqrt(single))
            least = np.maximum(together, CANCELLED * strongest)
            more = np.where(together > best, alone / np.where(least > 0, least, 1.0), more)
        best = np.maximum(best, together)
    return best, more
