"""Estimated error from diffraction at the outlines of planar reflectors.

Geometrical optics ends a reflector's light at a sharp boundary; waves have a transition over Fresnel zones, F of
:func:`rfgen_sionna.tracing.reflectors.reflector_shadows.fresnel_transition`. The difference is integrated edge by edge,
along the shadow boundary and across it, as far as the surface below extends. The estimate is of first order: near
corners each edge is taken as if the others were sharp. Edges of a reflector add in amplitude, as those of corner
reflectors are in phase.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray, IntArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.gains.element_pattern import PatternGain
from rfgen_sionna.tracing.integral.obliquity import strongest_reflection
from rfgen_sionna.tracing.integral.propagation import phasors
from rfgen_sionna.tracing.reflectors.clipped_footprints import DIRECT, ClippedFootprints
from rfgen_sionna.tracing.reflectors.planar_reflectors import PlanarPart, PlanarReflector, mirror_weights
from rfgen_sionna.tracing.reflectors.reflector_shadows import (
    DIRECT_SOURCE,
    ON_EDGE,
    image_sources,
    paths_over_edge,
    reflector_pairs,
    transition_integral,
    triangle_spans,
)
from rfgen_sionna.tracing.reflectors.shadow_targets import ImageSource, ShadowTargets, facet_targets, reflector_targets
from rfgen_sionna.tracing.surface.clip import clip_triangles, triangle_areas
from rfgen_sionna.tracing.surface.facets import Facets, sum_by_surface

SAFETY = 2.0
"""Safety factor of the estimate: at corners of shadows single edges are not exact."""
CELLS, MAX_CELLS = 12, 128
"""Parts of a shadow boundary on a reflector, least and most; the phase is linear in each."""
PARTS, MAX_ZONES = 8, 4.0
"""Parts across a shadow boundary, and their extent in v, the units of `fresnel_transition`."""
CELLS_PER_FACE = 2
"""Parts along a shadow boundary on a face of a curved surface."""
ANGLES = np.linspace(0.0, 1.0, 33)
"""Cosines of incidence of the table of reflection coefficients."""


CURVED = DIRECT - 1
"""Number of curved surfaces, in place of a planar part's; other than `DIRECT`."""


class EdgeDiffractionError:
    """Estimates the diffraction at reflectors' outlines that the returns by them lack, for facets of surfaces with
    `materials` in the groups `tolerance_group` (surface,)."""

    def __init__(self, radar: Radar, materials: Sequence[Material], tolerance_group: IntArray) -> None:
        self._view, self._wavelength = np.asarray(radar.position), radar.wavelength
        self._frequency, self._materials = radar.center_frequency, tuple(materials)
        self._tolerance_group = tolerance_group
        self._count = int(tolerance_group.max(initial=-1)) + 1
        self._gains = PatternGain(radar.pattern, radar.rotation).gains
        self._fields = radar.tx_field, radar.rx_field
        self._tables: dict[int, FloatArray] = {}

    def returned(self, paths: RadarPaths, surface: IntArray, knot: int = 0) -> ComplexArray:
        """(tolerance group,) coherent sum of `paths` at a knot, for the first element pair; `surface` (path,) is of
        their facets."""
        gain = np.sqrt(self._gains(paths.direction[:, knot]) * self._gains(paths.arrival[:, knot]))
        wave = paths.a[0, 0, :, knot] * phasors(paths.frequency * paths.tau[0, 0, :, knot]) * gain
        return sum_by_surface(wave[None], self._tolerance_group[surface], self._count)[0]

    def __call__(
        self,
        planar_parts: Sequence[PlanarPart],
        reflectors: Sequence[PlanarReflector | None],
        points: Sequence[FloatArray],
        facets: Facets,
        own: IntArray,
        area: FloatArray,
        footprint_sets: Sequence[tuple[ClippedFootprints, FloatArray]],
    ) -> FloatArray:
        """(tolerance group,) error of all returns by reflectors, as an amplitude.

        `reflectors` are those of all `planar_parts` that reflect now, `points` (vertex, 3) [m] of each surface. Facets
        are on the parts `own` (facet,), -1 for none. `area` (part,) [m^2] selects mirrors
        (:func:`rfgen_sionna.tracing.reflectors.planar_reflectors.mirror_weights`). `footprint_sets` are footprints with
        the amplitude (entry,) after slabs; both directions of a path count once.
        """
        known: dict[int, list[ImageSource]] = {DIRECT: [DIRECT_SOURCE]}
        triangles: dict[int, FloatArray] = {}

        def of(number: int) -> list[ImageSource]:
            if number not in known:
                known[number] = image_sources(reflectors[number], self._view)
            return known[number]

        def triangles_of(number: int) -> FloatArray:
            if number not in triangles:
                flat = planar_parts[number]
                triangles[number] = flat.triangles(points[flat.surface]) - self._view
            return triangles[number]

        # Paths by the same reflectors in any order may be in phase.
        together: defaultdict[tuple[int, frozenset[int]], float] = defaultdict(float)
        for footprints, left in footprint_sets:
            size, count = triangle_areas(footprints.pieces), len(footprints.facet)
            whole = _group_sums(footprints.owner, size, count)
            visible = left * _group_sums(footprints.owner, size * footprints.share, count)
            for first, last, entry in reflector_pairs(footprints):
                ways = [(one, other) for one in of(first) for other in of(last)]
                facet = footprints.facet[entry]
                for targets in (
                    reflector_targets(facet, visible[entry], ways, triangles_of, facets, own),
                    facet_targets(facet, whole[entry], visible[entry], facets, own, self._view),
                ):
                    if not len(targets.group):
                        continue
                    found = np.sum([self._along(targets, *way) for way in ways], axis=0)
                    found *= 1.0 if first == last else 2.0
                    found *= mirror_weights(area, targets.flat, np.full(len(found), first), np.full(len(found), last))
                    each = zip(targets.surface.tolist(), targets.flat.tolist(), found.tolist(), strict=True)
                    for surface, flat, value in each:
                        together[
                            int(self._tolerance_group[surface]), frozenset((first, last, flat if flat >= 0 else CURVED))
                        ] += value
        energy = np.zeros(self._count)
        for (tolerance_group, _), value in together.items():
            energy[tolerance_group] += value**2
        return SAFETY * np.sqrt(energy)

    def _along(self, targets: ShadowTargets, one: ImageSource, other: ImageSource) -> FloatArray:
        """(group,) sum over all edges of both reflectors."""
        pairs = [(one, other)] if other is DIRECT_SOURCE else [(one, other), (other, one)]
        return np.asarray(sum(np.abs(self._waves(targets, *pair)).sum(axis=0) for pair in pairs))

    def _waves(self, targets: ShadowTargets, source: ImageSource, other_source: ImageSource) -> ComplexArray:
        """(edge, group) change by each outer edge of `source`, in the light of all others."""
        edges, count, each = len(source.outer), len(targets.normal), len(targets.surface)
        none = np.zeros((edges, each), np.complex128)
        plane = bool((targets.flat >= 0).all())
        # Targets are repeated for each edge.
        pieces = np.tile(targets.pieces, (edges, 1, 1))
        owner = (np.arange(edges)[:, None] * count + targets.owner).ravel()
        side = np.repeat(source.outer, count)
        if not plane:  # of a curved surface only faces on the boundary
            height = np.einsum("pci,pi->pc", pieces, source.sides[side[owner]]) - source.offsets[side[owner], None]
            near = (height.min(axis=1) < 0) & (height.max(axis=1) > 0)
            pieces, owner = pieces[near], owner[near]
        rest = (source.sides, source.offsets), (other_source.sides, other_source.offsets)
        sides, offsets = (
            np.concatenate(both) for both in zip(*rest[: 1 if other_source is source else 2], strict=True)
        )
        pieces, owner = clip_triangles(pieces, owner, sides, offsets, side)
        # Axes along the boundary, and from it into the light.
        across = source.sides[side]
        normal = np.tile(targets.normal, (edges, 1))
        along = np.cross(across, normal)
        length = np.linalg.norm(along, axis=1)
        kept = length[owner] > ON_EDGE
        pieces, owner = pieces[kept], owner[kept]
        if not len(owner):
            return none
        used, owner = np.unique(owner, return_inverse=True)
        across, normal, side, target = across[used], normal[used], side[used], used % count
        along = along[used] / length[used, None]
        buffer = np.cross(normal, along)
        slant = np.einsum("ti,ti->t", buffer, across)
        buffer, slant = buffer * np.sign(slant)[:, None], np.abs(slant)
        middle = np.stack([_group_sums(owner, values, len(used)) for values in pieces.mean(axis=1).T], axis=1)
        middle /= np.bincount(owner, minlength=len(used))[:, None]
        line = middle - (np.einsum("ti,ti->t", middle - source.image, across) / slant)[:, None] * buffer
        t, s = (np.einsum("pci,pi->pc", pieces - line[owner, None], way[owner]) for way in (along, buffer))
        start, stop = np.full(len(used), np.inf), np.full(len(used), -np.inf)
        np.minimum.at(start, owner, t.min(axis=1))
        np.maximum.at(stop, owner, t.max(axis=1))
        wanted = (stop - start) / self._cell(line, source, other_source)
        cells = int(np.clip(np.ceil(wanted.max()), CELLS, MAX_CELLS)) if plane else CELLS_PER_FACE
        step = ((stop - start) / cells)[:, None]
        at = start[:, None] + (np.arange(cells) + 0.5) * step  # (target, cell)
        low, high = triangle_spans(t, s, at[owner])
        least, most = np.full(at.shape, np.inf), np.full(at.shape, -np.inf)
        np.minimum.at(least, owner, low)
        np.maximum.at(most, owner, high)
        aside = np.where(least < most, np.clip(0.0, least, np.maximum(most, least)), 0.0)
        places = line[:, None] + at[..., None] * along[:, None] + aside[..., None] * buffer[:, None]
        density, slope = self._density(targets, target, source, other_source, places, along)
        piece, cell = np.nonzero(low < high)
        which = owner[piece], cell
        line = which[0]
        foot = places[which] - aside[which][:, None] * buffer[line]
        begin, end = low[piece, cell], high[piece, cell]
        if not plane:  # the surface continues
            _, zone, _ = paths_over_edge(source, side[line], foot[:, None], normal[line])
            end = 2 * MAX_ZONES * np.sqrt(0.5 * self._wavelength * zone[:, 0]) / slant[line]
            begin = -end
        wave = self._across(
            source, other_source, side[line], foot, buffer[line], normal[line], np.stack([begin, end], axis=1),
            density[which],
        )  # fmt: skip
        scale = targets.weight[target][:, None] * step * np.sinc(slope * step / (2 * np.pi))
        value = wave * scale[which]
        index = (used // count * each + targets.group[target])[which[0]]
        found = _group_sums(index, value.real, none.size) + 1j * _group_sums(index, value.imag, none.size)
        return np.asarray(found.reshape(none.shape))

    def _across(
        self,
        source: ImageSource,
        other_source: ImageSource,
        edge: NDArray[np.intp],
        foot: FloatArray,
        buffer: FloatArray,
        normal: FloatArray,
        image_sources: FloatArray,
        density: FloatArray,
    ) -> ComplexArray:
        """(line,) change by one `edge` (line,) of `source` across its shadow boundary: over `image_sources` (line, 2)
        [m] in the direction `buffer` (line, 3), from a `foot` (line, 3) on the boundary. `normal` (line, 3) is of the
        surface, `density` (line, 2) the return of a square metre, proportional to the cosine of incidence and constant.
        """

        def units(s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            """Points, v there, and the return."""
            places = foot[:, None] + s[..., None] * buffer[:, None]
            longer, _, cosine = paths_over_edge(source, edge, places, normal)
            returned = density[:, :1] * cosine + density[:, 1:]
            return places, np.sign(s) * 2 * np.sqrt(longer / self._wavelength), returned

        # Phases are followed within some zones and extrapolated beyond.
        last = units(image_sources)[1]
        near = image_sources * np.minimum(MAX_ZONES / np.maximum(np.abs(last), 1e-300), 1.0)
        low, high = (
            np.where(np.sign(image_sources[:, k]) == sign, near[:, k], image_sources[:, k])
            for k, sign in enumerate((-1, 1))
        )
        followed = np.where((low < high)[:, None], np.stack([low, high], axis=1), image_sources)
        # Near the edge itself the detour grows linearly, else quadratically.
        root = np.sign(followed) * np.sqrt(np.abs(followed))
        root = root[:, :1] + np.diff(root, axis=1) * np.linspace(0.0, 1.0, PARTS + 1)
        s = root * np.abs(root)
        places, v, returned = units(s)
        to, fro = (np.linalg.norm(places - each.image, axis=2) for each in (source, other_source))
        phase = 2 * np.pi / self._wavelength * (to + fro)
        # Both are linear over each part.
        wide = np.maximum(np.diff(v, axis=1), 1e-9)
        slope = np.diff(phase, axis=1) / wide
        begin, end = v[:, :-1].copy(), v[:, :-1] + wide
        begin[:, 0], end[:, -1] = np.minimum(begin[:, 0], last[:, 0]), np.maximum(end[:, -1], last[:, 1])
        turned = np.exp(1j * (slope * v[:, :-1] - phase[:, :-1]))
        scale = 0.5 * (returned[:, 1:] + returned[:, :-1]) * np.diff(s, axis=1) / wide
        return np.asarray((scale * turned * transition_integral(begin, end, slope)).sum(axis=1))

    def _cell(self, line: FloatArray, source: ImageSource, other_source: ImageSource) -> FloatArray:
        """(target,) length [m] over which the phase along the boundary bends by less than about a radian."""
        near = np.minimum(*(np.linalg.norm(line - each.image, axis=1) for each in (source, other_source)))
        return np.asarray(np.sqrt(2 * self._wavelength * near / np.pi))

    def _density(
        self,
        targets: ShadowTargets,
        chosen: NDArray[np.intp],
        source: ImageSource,
        other_source: ImageSource,
        places: FloatArray,
        along: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return of a square metre of the `chosen` targets at `places` (target, cell, 3), as :meth:`_across` takes it
        (target, cell, 2), and the phase slope there `along` (target, 3) (target, cell) [rad/m]."""
        normal = targets.normal[chosen]
        common, slope = np.full(places.shape[:2], 1 / (4 * np.pi)), np.zeros(places.shape[:2])
        cosine, parts = [], []
        for end in (source, other_source):
            way = places - end.image
            length = np.maximum(np.linalg.norm(way, axis=2), ON_EDGE)
            way = way / length[..., None]
            slope = slope + 2 * np.pi / self._wavelength * np.einsum("tci,ti->tc", way, along)
            visible = way @ end.normal
            # Direction from the radar.
            gain = self._gains(way - 2 * visible[..., None] * end.normal)
            common = common * np.sqrt(gain) / length * self._reflection(end.material, np.abs(visible))
            cosine.append(np.abs(np.einsum("tci,ti->tc", way, normal)))
            parts.append([_polarised(field, end, way, normal) for field in self._fields])
        own = targets.surface[targets.group[chosen]]
        for number in np.unique(own):
            common[own == number] *= self._reflection(self._materials[number], cosine[0][own == number])
        # Both directions: currents go with the cosine of incidence for s polarisation, of departure for p.
        (tx, rx), (far_tx, far_rx) = parts
        across, rest = (0.5 * (tx[n] * far_rx[n] + rx[n] * far_tx[n]) for n in (0, 1))
        return np.stack([common * across, common * rest * cosine[1]], axis=2), slope

    def _reflection(self, material: Material | None, cosine: FloatArray) -> FloatArray | float:
        """The larger Fresnel coefficient; 1 for the straight leg."""
        if material is None:
            return 1.0
        if id(material) not in self._tables:
            same, band = np.zeros(len(ANGLES), np.int32), np.array([self._frequency])
            self._tables[id(material)] = strongest_reflection([material], same, ANGLES, band)
        return np.interp(cosine, ANGLES, self._tables[id(material)])


def _polarised(
    field: FloatArray, end: ImageSource, way: FloatArray, normal: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(target, cell) shares of an element's field in directions `way` (target, cell, 3) from an `end`, across and in
    the plane of incidence on surfaces with a `normal` (target, 3)."""
    field = field - 2 * (field @ end.normal) * end.normal
    field = field - (way @ field)[..., None] * way
    field = field / np.maximum(np.linalg.norm(field, axis=2, keepdims=True), 1e-12)
    across = np.cross(way, normal[:, None])
    size = np.linalg.norm(across, axis=2)
    share = np.abs((field * across).sum(axis=2)) / np.maximum(size, ON_EDGE)
    share = np.where(size > ON_EDGE, np.minimum(share, 1.0), 1.0)
    return share, np.sqrt(1 - share**2)


def _group_sums(group: NDArray[np.intp], values: FloatArray, count: int) -> FloatArray:
    """(group,) sums of `values`."""
    return np.asarray(np.bincount(group, values, count), np.float64)
