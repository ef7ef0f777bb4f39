"""Returns by way of flat parts of anything: corner reflectors, from body to board, furniture.

Of two surfaces on a path one is the mirror (geometrical optics: the image of the radar, cut to the shadow of the
mirror's outline), the other is integrated (physical optics): radar, mirror, facet, radar and the same backwards. Of
three the middle one is integrated, for the images of Tx and Rx behind the two others. So Tx and Rx may be changed over
without changing anything. Of two flat parts each is the mirror once, or the much larger one alone
(:mod:`rfgen_sionna.tracing.bounces.roles`).

A radar that moves sees the scene move (:mod:`rfgen_sionna.tracing.relative`): walls are plates then, and ghosts in
them, furniture and corners of the room are traced here as well.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.bounces.landing import DIRECT, LandedFacets, Landing, LandingBand, joined
from rfgen_sionna.tracing.bounces.mirror_edges import MirrorEdges
from rfgen_sionna.tracing.bounces.plates import FlatPart, Plate, find_flats, least_widths, meeting, wide_plates
from rfgen_sionna.tracing.bounces.roles import BOUNDLESS, role_shares
from rfgen_sionna.tracing.bounces.shower import Shower
from rfgen_sionna.tracing.ghosts.image_band import ImageBand
from rfgen_sionna.tracing.ghosts.image_returns import WAYS, Centroids, ImageReturns
from rfgen_sionna.tracing.ghosts.mirrors import Mirror
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.surfaces import Surfaces, lots

SKIPPED = 0.5
"""Share of the tolerance that the returns left out may make up together."""
IMAGE_SAMPLES = 200
"""Vertices of an image in a plate that moves that tell how many knots delays need."""
REST = 3
"""Stretches of time for which what was too weak is not looked at again, up to twice that, in turns ..."""
GROWN = 1.1
"""... unless plates may show so many times more facets than when it came to rest."""
MOST_IMAGES = 12
"""Plates whose images do."""


@dataclass(frozen=True)
class Bounced:
    """What plates show of facets at an instant."""

    once: Landing
    """One way by a plate, the other straight."""
    twice: Landing
    """Both ways by plates, in either order."""
    looked_at: int
    rays: int
    left: Callable[[Landing], FloatArray]
    """(entry,) amplitude that is left at most by what the ways go through."""


class Bounces:
    """Finds and traces what plates show of moving surfaces, but for what the ghosts in walls that stay are.

    Parameters
    ----------
    surfaces
        All of the scene.
    radar
        Where it stands.
    rtol
        Tolerance, relative to the return of each actor.
    max_bounces
        2 or 3.
    walls
        The mirrors that ghosts are traced by, asked for at first use.
    """

    def __init__(
        self,
        surfaces: Surfaces,
        radar: Radar,
        rtol: float,
        max_bounces: int,
        walls: Callable[[], tuple[Mirror, ...]],
    ) -> None:
        self._surfaces, self._radar, self._rtol, self._max_bounces = surfaces, radar, rtol, max_bounces
        self._walls = walls
        self._viewpoint = np.asarray(radar.position)
        self._flats: tuple[FlatPart, ...] | None = None
        self._positions: Callable[[float], Sequence[FloatArray]] = lambda _: ()
        self._meeting: list[set[int]] = []  # (plate,) those that it has an edge in common with
        self._stretch = 0
        # Until when what is too weak is left alone: plates, and kind, surface and plates of groups.
        self._until: dict[tuple[int, ...], int] = {}
        # (plate, surface) facets that plates may show: lately, and when each of those came to rest.
        self._counts: IntArray = np.zeros((0, len(surfaces.moving)), np.int32)
        self._rested: dict[tuple[int, ...], IntArray] = {}
        self._skipped = set[tuple[int, ...]]()  # in this stretch
        self._imaging: list[int] = []
        self._plates: dict[float, tuple[Plate | None, ...]] = {}
        # (surface,) of those that move: whether it is the radar that does.
        self._still = np.array([surface.still for surface in surfaces.moving], np.bool_)
        names = surfaces.object_names, surfaces.part_names
        self._returns = ImageReturns(surfaces.moving, names, radar, rtol, self._mirrors, self._band)
        self._edges = MirrorEdges(radar, [each.material for each in surfaces.moving], lots(surfaces.moving))

    def follow(self, positions: Callable[[float], Sequence[FloatArray]], t: float) -> bool:
        """Take the vertices of the moving surfaces from `positions` for a stretch of time that `t` [s] is in; whether
        there is any flat part at all."""
        self._positions = positions
        self._plates.clear()
        if self._flats is None:
            vertices = [*self._surfaces.static_vertices, *positions(t)]
            every = (*self._surfaces.static, *self._surfaces.moving)
            counts = len(self._surfaces.static), len(self._surfaces.moving)
            self._flats = find_flats(every, vertices, least_widths(*counts, self._radar.wavelength))
            self._counts = np.zeros((len(self._flats), len(self._surfaces.moving)), np.int32)
            if self._still.any():
                self._meeting = meeting(self._flats, vertices)
        self._imaging = self._chosen(t)
        return len(self._flats) > 0

    def followed(self, vertices: Sequence[FloatArray]) -> list[FloatArray]:
        """A choice of the images of the actors' `vertices` in plates, whose distances the delays follow: in the same
        ones throughout a stretch of time, whatever side they turn to the radar."""
        every = [*self._surfaces.static_vertices, *vertices]
        few = [points[:: max(1, len(points) // IMAGE_SAMPLES)] for points in vertices]
        flats = [self.flats[number] for number in self._imaging]
        return [flat.image(every[flat.surface], points) for flat in flats for points in few]

    def _chosen(self, t: float) -> list[int]:
        """Plates in which images are followed: some of those that move and show something at `t` [s]."""
        first, plates = len(self._surfaces.static), zip(self.flats, self.at(t), strict=True)
        moving = [n for n, (flat, plate) in enumerate(plates) if flat.surface >= first and plate is not None]
        return moving[:: max(1, -(-len(moving) // MOST_IMAGES))]

    @property
    def flats(self) -> tuple[FlatPart, ...]:
        """Flat parts of all surfaces, after :meth:`follow`."""
        return self._flats or ()

    def at(self, t: float) -> tuple[Plate | None, ...]:
        """The plates as they are at `t` [s]."""
        if t not in self._plates:
            count, moving = len(self._surfaces.static), self._positions(t)
            self._plates[t] = tuple(
                self._fixed[number] if flat.surface < count else flat.at(moving[flat.surface - count], self._viewpoint)
                for number, flat in enumerate(self.flats)
            )
        return self._plates[t]

    def _mirrors(self, t: float) -> tuple[Mirror, ...]:
        """The plates at `t` [s], blind ones in place of those that are none."""
        return tuple(blind if plate is None else plate for plate, blind in zip(self.at(t), self._blind, strict=True))

    @cached_property
    def _blind(self) -> list[Plate]:
        up, none = np.array([0.0, 0.0, 1.0]), np.zeros(2)
        return [Plate(f.name, f.material, f.faces[:0], up, 0.0, np.eye(3)[:2], none, none, ()) for f in self.flats]

    @cached_property
    def _fixed(self) -> list[Plate | None]:
        points, view = self._surfaces.static_vertices, self._viewpoint
        return [flat.at(points[flat.surface], view) if flat.surface < len(points) else None for flat in self.flats]

    @cached_property
    def owner(self) -> IntArray:
        """(face,) number of the plate that each face of the ray scene belongs to, -1 for none."""
        every = (*self._surfaces.static, *self._surfaces.moving)
        owner = np.full(sum(len(each.faces) for each in every), -1, np.int32)
        for number, flat in enumerate(self.flats):
            owner[flat.faces] = number
        return owner

    @cached_property
    def _wall(self) -> NDArray[np.bool_]:
        """(plate,) whether it is a wall that ghosts are traced by."""
        of_walls = {int(number) for wall in self._walls() for number in wall.faces}
        return np.array([int(flat.faces[0]) in of_walls for flat in self.flats], np.bool_)

    @cached_property
    def _stays(self) -> NDArray[np.bool_]:
        """(plate,) whether it stays in the world."""
        every = (*self._surfaces.static, *self._surfaces.moving)
        return np.array([every[flat.surface].still for flat in self.flats], np.bool_)

    @cached_property
    def _area(self) -> FloatArray:
        """(plate,) [m^2], those of which no facets are there to be integrated being `BOUNDLESS`."""
        fixed = len(self._surfaces.static)
        return np.array([BOUNDLESS if flat.surface < fixed else flat.area for flat in self.flats])

    def see(self, t: float, rays: RayScene, facets: Facets, fraction: FloatArray) -> Bounced:
        """What the plates show at `t` [s] of the facets, of which `fraction` (facet,) is seen directly."""
        wall, still = self._wall, self._stays
        shower, seen = self._shower(t, rays, facets), self._straight(facets, fraction)
        own = self.owner[facets.number]
        lit, once = {}, []
        for number, plate in enumerate(self.at(t)):
            reached = shower.candidates(number) if plate is not None else np.zeros(0, np.intp)
            reached = reached[own[reached] != number]
            self._counts[number] = np.bincount(facets.surface[reached], minlength=self._counts.shape[1])
            if len(reached) == 0 or self._rests((number,), self._counts[number]):
                continue
            lit[number] = reached
            if not wall[number]:
                chosen = reached[seen[reached] & (role_shares(self._area, own[reached], number, DIRECT) > 0)]
                once.append(shower.land(self._strong(chosen, facets, number, DIRECT), number, DIRECT))
        twice = []
        if self._max_bounces > 2:
            across = self._across(t)
            for number, first in lit.items():
                for other, last in lit.items():
                    walls = still[number] and still[other]
                    if other < number or (walls and (wall[number] or other not in across[number])):
                        continue
                    both = np.intersect1d(first, last, assume_unique=True)
                    found = shower.land(self._strong(both, facets, number, other), number, other)
                    twice.append(found)
                    if other != number:
                        twice.append(found.swapped())
        looked_at = sum(len(each) for each in lit.values())
        return Bounced(self._joined(once), self._joined(twice), looked_at, shower.sent, shower.left)

    # What these are is another thing where slabs are seen through.

    def _shower(self, t: float, rays: RayScene, facets: Facets) -> Shower:
        return Shower(rays, self.at(t), self.owner, self._viewpoint, facets, self._radar.max_range)

    def _straight(self, facets: Facets, fraction: FloatArray) -> NDArray[np.bool_]:
        """(facet,) which may be seen the straight way."""
        return np.asarray(fraction > 0)

    def _joined(self, landings: Sequence[Landing]) -> Landing:
        return joined(landings)

    def _shown(
        self, facets: Sequence[Facets], keys: NDArray[np.int64], landings: Sequence[Landing], swapped: bool
    ) -> Sequence[LandedFacets]:
        """Facets by `keys` as they are seen at each of some instants."""
        both = zip(facets, landings, strict=True)
        return [LandedFacets.landed(there, keys, landing, swapped) for there, landing in both]

    def _band(self, radar: Radar, rtol: float, mirrors: Sequence[Mirror], tx: bool, rx: bool) -> ImageBand:
        return LandingBand(radar, rtol, mirrors, tx, rx)

    def _across(self, t: float) -> list[set[int]]:
        """(plate,) by way of which plates that stay in the world, together with each of them, others are shown: itself,
        and to a radar that moves those that it meets, as in corner reflectors, and among wide ones all others."""
        found = [{number} for number in range(len(self.flats))]
        if not self._still.any():
            return found
        for number, others in enumerate(self._meeting):
            found[number] |= others
        scene = [points for points, still in zip(self._positions(t), self._still, strict=True) if still]
        radar = self._radar
        wide = wide_plates(self.flats, self.at(t), scene, self._viewpoint, radar.wavelength, radar.max_range)
        for number in wide:
            found[number].update(wide)
        return found

    def _strong(self, index: NDArray[np.intp], facets: Facets, first: int, last: int) -> NDArray[np.intp]:
        """Those of the facets `index` whose surface was not too weak by these plates lately."""
        surface = facets.surface[index]
        keys = [(int(last != DIRECT), number, first, last) for number in np.unique(surface).tolist()]
        resting = [key[1] for key in keys if self._rests(key, self._shown_by(key))]
        return index[~np.isin(surface, resting)] if resting else index

    def _rests(self, key: tuple[int, ...], count: IntArray) -> bool:
        """Whether a plate or group is left alone, where plates may show so many facets."""
        rests = self._until.get(key, -1) > self._stretch and bool((count <= GROWN * self._rested[key]).all())
        if rests:
            self._skipped.add(key)
        return rests

    def _shown_by(self, key: tuple[int, ...]) -> IntArray:
        """Facets that the plates of a group, or a plate alone, may show of its surface, or of each."""
        if len(key) == 1:
            return self._counts[key[0]]
        return np.array([self._counts[plate, key[1]] for plate in key[2:] if plate != DIRECT], np.int32)

    def trace(
        self,
        knots: FloatArray,
        instants: FloatArray,
        facets: Sequence[Facets],
        seen: Sequence[Bounced],
        centroids: Centroids,
        usual: FloatArray,
    ) -> tuple[list[RadarPaths], float]:
        """Paths and their error, relative to the actors' direct returns `usual` (surface,) or their own.

        `facets` and `seen` are those of each of the `instants` [s]; delays are for the `knots` [s].
        """
        middle, paths, error, used = len(instants) // 2, [], 0.0, set[int]()
        usual = self._shared(usual)
        weak, usual = self._weak(float(instants[middle]), facets[middle], seen[middle], usual)
        total, knot = np.zeros(1, np.complex128), int(np.abs(knots - instants[middle]).argmin())
        for way in WAYS:
            landings = [each.twice if all(way) else each.once for each in seen]
            keys = np.unique(np.concatenate([each.keys for each in landings]), axis=0)
            groups = _groups(keys, facets[middle])
            keys = keys[[tuple(group) not in weak[all(way)] for group in groups.tolist()]]
            if len(keys) == 0:
                continue
            shown = self._counted(facets, keys, landings, way == (False, True))
            used.update(keys[:, 1:3].ravel().tolist())
            ones = np.ones((len(instants), len(keys)))
            column = keys[:, 0].astype(np.intp)
            more, missed = self._returns(way, knots, instants, shown, ones, column, centroids, usual)
            paths.append(more)
            error += missed
            total = total + self._edges.returned(more, facets[middle].surface[column], knot)
        self._returns.finish(error)
        self._stretch += 1
        idle = [(number,) for number in range(len(self.flats)) if number not in used]
        for key in (*idle, *((kind, *group) for kind, those in enumerate(weak) for group in those)):
            if key not in self._skipped:
                # Not all at once: what comes back is looked at in turns.
                self._until[key] = self._stretch + REST + sum(key) % REST
                self._rested[key] = self._shown_by(key).copy()
        self._skipped.clear()
        # No facets mend what the mirrors' outlines do.
        if paths:
            level = np.abs(total)
            np.maximum.at(level, lots(self._surfaces.moving), usual)
            beside = self._beside(float(instants[middle]), facets[middle], seen[middle], weak)
            error = float(np.hypot(error, (beside / np.maximum(level, 1e-300)).max()))
        return paths, error

    def _beside(
        self, t: float, facets: Facets, seen: Bounced, weak: tuple[set[tuple[int, ...]], set[tuple[int, ...]]]
    ) -> FloatArray:
        """(lot,) what waves make of the outlines of the plates that show something at `t` [s]."""
        points = [*self._surfaces.static_vertices, *self._positions(t)]
        landings = []
        for landing, those in zip((seen.once, seen.twice), weak, strict=True):
            groups = _groups(landing.keys, facets).tolist()
            strong = landing.take(np.array([tuple(group) not in those for group in groups], np.bool_))
            landings.append((strong, seen.left(strong)))
        return self._edges(self.flats, self.at(t), points, facets, self.owner[facets.number], self._area, landings)

    def _counted(
        self, facets: Sequence[Facets], keys: NDArray[np.int64], landings: Sequence[Landing], swapped: bool
    ) -> list[LandedFacets]:
        """As :meth:`_shown`, each by how much it counts."""
        shares = role_shares(self._area, self.owner[facets[0].number[keys[:, 0]]], keys[:, 1], keys[:, 2])
        return [shown.times(shares) for shown in self._shown(facets, keys, landings, swapped)]

    def _shared(self, usual: FloatArray) -> FloatArray:
        """(surface,) levels that errors are relative to: for what stays in the world the strongest one's."""
        return np.where(self._still, usual[self._still].max(initial=0.0), usual)

    def _weak(
        self, t: float, facets: Facets, seen: Bounced, usual: FloatArray
    ) -> tuple[tuple[set[tuple[int, ...]], set[tuple[int, ...]]], FloatArray]:
        """Groups (surface, first, last) of `seen.once` and `seen.twice` that are too weak to count, and the level of
        each surface's strongest return, direct or not."""
        found: list[tuple[NDArray[np.int64], FloatArray]] = []
        usual = usual.copy()
        for landing, way in ((seen.once, (True, False)), (seen.twice, (True, True))):
            groups, index = np.unique(_groups(landing.keys, facets), axis=0, return_inverse=True)
            if len(groups) == 0:
                continue
            (shown,) = self._counted([facets], landing.keys, [landing], False)
            coherent, single = self._returns.levels(way, t, shown, index.reshape(-1), len(groups))
            np.maximum.at(usual, groups[:, 0], coherent)
            times = 1 if all(way) else 2  # both ways round
            found.append(
                (np.column_stack([np.full(len(groups), all(way)), groups]), times * np.maximum(coherent, single))
            )
        usual = self._shared(usual)
        weak: tuple[set[tuple[int, ...]], set[tuple[int, ...]]] = (set(), set())
        if found:
            groups, levels = (np.concatenate([each[part] for each in found]) for part in (0, 1))
            lot = np.where(self._still, -1, np.arange(len(usual)))  # what stays shares one tolerance
            for each in np.unique(lot):
                index = np.flatnonzero(lot[groups[:, 1]] == each)
                index = index[np.argsort(levels[index], kind="stable")]
                level = usual[lot == each].max()
                for number in index[np.cumsum(levels[index]) <= SKIPPED * self._rtol * level]:
                    weak[groups[number, 0]].add(tuple(groups[number, 1:].tolist()))
        return weak, usual


def _groups(keys: NDArray[np.int64], facets: Facets) -> NDArray[np.int64]:
    """(entry, 3) surface and plates of entries by their keys."""
    return np.column_stack([facets.surface[keys[:, 0]], keys[:, 1:3]]).astype(np.int64)
