"""Rays followed from hit to hit. Each is traced once, whoever asks for it again."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.rays import BLIND_GAP, RayScene
from rfgen_sionna.tracing.curved.media import polarisation_bases, reflected_direction
from rfgen_sionna.tracing.visibility.slab_layers import MAX_SLABS
from tests.reference.sbr import lattice
from tests.reference.sbr.media import SlabOptics
from tests.reference.sbr.skin import RaySkin

_GAP = 2e-6
"""Rays leave a surface this far above it, times the distance from the origin: twenty times what float32 resolves."""
_TRIES = 4
"""How often a ray that meets the surface it has just left is sent on."""
_THROUGH = 32
"""Surfaces, at most, before what is looked for behind them: two of everything that is closed."""
_STRETCH = 4.0
"""Surfaces are extended to at most this many times the distance: at grazing incidence a tangent plane runs away."""
NOTHING = -1
_COLUMNS = (
    "parent", "point", "flat", "normal", "ray", "patch", "weights", "leg", "length", "power", "facet", "surface",
    "chain", "sign", "unoccluded", "out", "out_normal",
)  # fmt: skip
Index = NDArray[np.intp]


@dataclass
class Setting:
    """What rays are followed through, and how many were sent."""

    rays: RayScene
    skin: RaySkin
    optics: SlabOptics
    surface: NDArray[np.int32]
    """(facet,) number of the surface that each face belongs to."""
    source: FloatArray
    """(3,) [m]"""
    rotation: FloatArray
    """(3, 3) of the lattice of directions."""
    longest: float
    """Length of the longest way there [m]."""
    least: float
    """Share of the power below which a ray is left alone."""
    transmission: bool
    sent: int = 0
    met: int = 0
    by_depth: dict[int, int] = field(default_factory=dict)


class Hits:
    """What rays meet at one place of their way, by node of the lattice.

    Parameters
    ----------
    setting
        The scene.
    before
        Their hits before that; None where these are the first.
    through
        Whether they go through the surface hit before, a slab, and are not reflected by it.
    """

    def __init__(self, setting: Setting, before: Hits | None = None, through: bool = False) -> None:
        self.setting, self.before, self.through = setting, before, through
        self.reflections: int = 0 if before is None else before.reflections + (not through)
        self.passages: int = 0 if before is None else before.passages + through
        self._known = np.zeros(0, np.int64)
        self._row = np.zeros(0, np.intp)
        self.parent = np.zeros(0, np.intp)
        """(row,) row of the hit before."""
        self.point, self.flat, self.normal, self.ray = (np.zeros((0, 3)) for _ in range(4))
        """(row, 3) place on the smooth surface and on the mesh [m], normal towards the ray, and the ray's direction."""
        self.patch = np.zeros((0, 3, 3))
        self.weights = np.zeros((0, 3))
        self.leg, self.length, self.power = (np.zeros(0) for _ in range(3))
        """(row,) from the hit before, and from the source [m]; share of the power that surfaces have left."""
        self.facet, self.surface = np.zeros(0, np.int64), np.zeros(0, np.int32)
        self.chain, self.sign = np.zeros(0, np.int64), np.zeros(0, np.int64)
        """(row,) what was hit all the way; and with how the radar sees it. 0 is nothing."""
        self.unoccluded = np.zeros(0, np.bool_)
        """(row,) whether the source sees the point directly."""
        self.out, self.out_normal = np.zeros((0, MAX_SLABS), np.int32), np.zeros((0, MAX_SLABS, 3))
        """(row, slab) slabs between the point and the source, and their normals."""

    @property
    def ancestors(self) -> list[Hits]:
        """All hits from the first one on, these included."""
        return [*(self.before.ancestors if self.before is not None else []), self]

    def rows(self, nodes: lattice.Nodes) -> Index:
        """(node,) row of each node (node, 3); unknown ones are traced."""
        key = lattice.keys(nodes)
        place = np.searchsorted(self._known, key)
        at = np.minimum(place, max(len(self._known) - 1, 0))
        new = self._known[at] != key if len(self._known) else np.ones(len(key), np.bool_)
        if new.any():
            fresh, first = np.unique(key[new], return_index=True)
            start = len(self.leg)
            self._trace(nodes[np.flatnonzero(new)[first]])
            known = np.concatenate([self._known, fresh])
            row = np.concatenate([self._row, np.arange(start, start + len(fresh))])
            order = np.argsort(known, kind="stable")
            self._known, self._row = known[order], row[order]
            at = np.searchsorted(self._known, key)
        return self._row[at]

    def _trace(self, nodes: lattice.Nodes) -> None:
        setting, count = self.setting, len(nodes)
        if self.before is None:
            parent = np.full(count, NOTHING, np.intp)
            ray = lattice.directions(nodes, setting.rotation)
            start = np.broadcast_to(setting.source, ray.shape)
            length, power, chain = np.zeros(count), np.ones(count), np.ones(count, np.int64)
            left = np.full(count, NOTHING, np.int64)
            alive = np.arange(count)
        else:
            before = self.before
            parent = before.rows(nodes)
            ray, start = before.ray[parent].copy(), before.point[parent]
            left, length, chain = before.facet[parent], before.length[parent], before.chain[parent]
            power = self._left(parent)
            if not self.through:
                ray = reflected_direction(ray, before.normal[parent])
            alive = np.flatnonzero((chain != 0) & (power > setting.least))
        found = _Found(count)
        if len(alive):
            self._first(alive, start[alive], ray[alive], left[alive], found)
        there = np.flatnonzero(found.facet >= 0)
        met = setting.skin.meet(start[there], ray[there], found.facet[there], found.weights[there])
        point, normal, patch, weights = (
            np.zeros((count, 3)),
            np.zeros((count, 3)),
            np.zeros((count, 3, 3)),
            found.weights,
        )
        point[there], normal[there], patch[there], weights[there] = met.point, met.normal, met.patch, met.weights
        leg = lengths(point - start)
        length = length + leg
        facet = np.where((found.facet >= 0) & (length < setting.longest), found.facet, NOTHING)
        sheet = np.where(facet >= 0, setting.skin.sheet[facet] + 1, 0).astype(np.int64)
        chain = np.where(facet >= 0, chain * 1_000_003 + sheet * 2 + self.through, 0)
        unoccluded = facet >= 0
        out, out_normal = np.full((count, MAX_SLABS), NOTHING, np.int32), np.zeros((count, MAX_SLABS, 3))
        if self.before is not None:
            if self.reflections:
                unoccluded &= np.einsum("ri,ri->r", setting.source - point, normal) > 0
                self._visibility(unoccluded, found.flat, facet, out, out_normal)
            else:  # straight: what was gone through on the way there
                for depth, hits in enumerate(self.before.ancestors):
                    row = _up(self.before, parent, len(self.before.ancestors) - 1 - depth)
                    out[:, depth], out_normal[:, depth] = hits.surface[row], hits.normal[row]
        sign = chain.copy()
        for depth in range(MAX_SLABS):
            sign = sign * 1_000_003 + out[:, depth] + 2
        sign = np.where(facet >= 0, sign * 2 + unoccluded, 0)
        setting.met += int((facet >= 0).sum())
        surface = np.where(facet >= 0, setting.surface[facet], NOTHING).astype(np.int32)
        new = {
            "parent": parent, "point": point, "flat": found.flat, "normal": normal, "ray": ray, "patch": patch,
            "weights": weights, "leg": leg, "length": length, "power": power, "facet": facet, "surface": surface,
            "chain": chain, "sign": sign, "unoccluded": unoccluded, "out": out, "out_normal": out_normal,
        }  # fmt: skip
        self._add(new)

    def extended(self, nodes: lattice.Nodes, like: Index) -> Index:
        """(node,) rows for rays through nodes (node, 3) that go on, hit by hit, on the surface around the hits of the
        rays in rows `like` (node,), as if it didn't end; no ray is sent."""
        if self.before is None:
            parent = np.full(len(nodes), NOTHING, np.intp)
            ray = lattice.directions(nodes, self.setting.rotation)
            start, length = np.broadcast_to(self.setting.source, ray.shape), np.zeros(len(nodes))
        else:
            parent = self.before.extended(nodes, self.parent[like])
            ray, start = self.before.ray[parent], self.before.point[parent]
            length = self.before.length[parent]
            if not self.through:
                ray = reflected_direction(ray, self.before.normal[parent])
        normal, patch = self.normal[like], self.patch[like]
        facing = np.einsum("ri,ri->r", ray, normal)
        facing = np.where(np.abs(facing) < 1e-9, -1e-9, facing)
        leg = np.einsum("ri,ri->r", self.point[like] - start, normal) / facing
        leg = np.clip(leg, self.leg[like] / _STRETCH, self.leg[like] * _STRETCH)
        offset = start + leg[:, None] * ray - self.point[like]
        turn = np.einsum("rij,rj->ri", patch, offset)
        turn *= np.minimum(1.0, 0.5 / np.maximum(lengths(turn), 1e-12))[:, None]
        leg = leg - np.clip(0.5 * np.einsum("ri,ri->r", turn, offset) / facing, -0.5 * leg, 0.5 * leg)
        normal = normal + turn
        point = start + leg[:, None] * ray
        first = len(self.leg)
        new = {name: getattr(self, name)[like] for name in _COLUMNS}
        new |= {
            "parent": parent, "point": point, "flat": point, "ray": ray, "leg": leg, "length": length + leg,
            "normal": normal / lengths(normal)[:, None],
        }  # fmt: skip
        self._add(new)
        return np.arange(first, first + len(nodes))

    def behind(self, nodes: lattice.Nodes, like: Index) -> tuple[Index, NDArray[np.bool_]]:
        """(node,) rows of first hits for rays through nodes (node, 3) on to the sheet that rows `like` (node,) hit,
        through whatever is before it; and whether they meet it at all: else they go on as `extended` has it."""
        skin, setting = self.setting.skin, self.setting
        first, wanted = self.rows(nodes), skin.sheet[self.facet[like]]
        there = (self.facet[first] >= 0) & (skin.sheet[self.facet[first]] == wanted)
        rows = first.copy()
        lane = np.flatnonzero(~there)
        rows[lane] = self.extended(nodes[lane], like[lane])
        begun = self.leg[first]
        lane = lane[self.facet[first[lane]] >= 0]
        for _ in range(_THROUGH):
            if len(lane) == 0:
                break
            row = rows[lane]
            begun[lane] += 1e-6 + _GAP * begun[lane]
            hits = setting.rays.first_hit(setting.source + begun[lane, None] * self.ray[row], self.ray[row])
            self.count(len(lane))
            own = (hits.facet >= 0) & (skin.sheet[np.maximum(hits.facet, 0)] == wanted[lane])
            self._put(row[own], hits.facet[own], hits.barycentric[own])
            there[lane[own]] = True
            begun[lane] += np.where(np.isfinite(hits.distance), hits.distance, 0.0)
            lane = lane[~own & (hits.facet >= 0)]
        return rows, there

    def _put(self, row: Index, facet: NDArray[np.int64], weights: FloatArray) -> None:
        """Have rays of `row` (row,), straight from the source, meet `facet` at barycentric coordinates `weights`."""
        skin, source = self.setting.skin, self.setting.source
        met = skin.meet(np.broadcast_to(source, (len(row), 3)), self.ray[row], facet, weights)
        self.point[row], self.normal[row], self.patch[row], self.weights[row] = (
            met.point,
            met.normal,
            met.patch,
            weights,
        )
        self.flat[row] = np.einsum("rc,rci->ri", weights, skin.corners[facet])
        self.leg[row] = self.length[row] = lengths(met.point - source)
        self.facet[row] = facet

    def _add(self, new: dict[str, NDArray[Any]]) -> None:
        for name in _COLUMNS:
            setattr(self, name, np.concatenate([getattr(self, name), new[name]]))

    def _left(self, parent: Index) -> FloatArray:
        """(ray,) share of the power that the surface before leaves, at most."""
        before, optics = self.before, self.setting.optics
        if before is None:
            return np.ones(len(parent))
        power = before.power[parent]
        lane = np.flatnonzero(before.facet[parent] >= 0)
        row = parent[lane]
        surface = before.surface[row]
        if self.through:
            power[lane[~optics.penetrable[surface]]] = 0.0
            lane, row = (each[optics.penetrable[surface]] for each in (lane, row))
            surface = before.surface[row]
        cos, _, _ = polarisation_bases(before.ray[row], before.normal[row])
        pair = (optics.transmission if self.through else optics.reflection)(surface, cos, optics.centre)
        power[lane] *= np.maximum(np.abs(pair[0]), np.abs(pair[1])) ** 2
        return power

    def _first(self, lane: Index, start: FloatArray, ray: FloatArray, left: NDArray[np.int64], found: _Found) -> None:
        """What rays hit first, but for the surface that they have just left."""
        setting = self.setting
        skip = np.zeros(len(lane))
        if self.before is not None:
            rise = np.abs(setting.skin.sagittas[np.maximum(left, 0)]).max(axis=(1, 2))
            skip = _GAP * lengths(start - setting.rays.origin) + 1e-6 + 2.0 * rise
        gap = skip.copy()
        open_ = np.arange(len(lane))
        for _ in range(_TRIES):
            hits = setting.rays.first_hit(start[open_] + skip[open_, None] * ray[open_], ray[open_])
            self.count(len(open_))
            again = (hits.facet >= 0) & (hits.facet == left[open_]) if self.before is not None else hits.facet < -1
            if self.before is not None:
                sheet = setting.skin.sheet
                own = (hits.facet >= 0) & (sheet[np.maximum(hits.facet, 0)] == sheet[np.maximum(left[open_], 0)])
                again |= own & (hits.distance < 2.0 * gap[open_])
            done = np.flatnonzero(~again)
            there = lane[open_[done]]
            found.facet[there], found.weights[there] = hits.facet[done], hits.barycentric[done]
            skip[open_] += np.where(again, np.where(np.isfinite(hits.distance), hits.distance, 0.0) + gap[open_], 0.0)
            open_ = open_[again]
            if len(open_) == 0:
                break
        hit = np.flatnonzero(found.facet >= 0)
        found.flat[hit] = np.einsum("rc,rci->ri", found.weights[hit], setting.skin.corners[found.facet[hit]])

    def count(self, rays: int) -> None:
        """Rays that were sent."""
        setting = self.setting
        setting.sent += rays
        depth = self.reflections + 1
        setting.by_depth[depth] = setting.by_depth.get(depth, 0) + rays

    def _visibility(
        self,
        unoccluded: NDArray[np.bool_],
        target: FloatArray,
        facet: NDArray[np.int64],
        out: NDArray[np.int32],
        normals: FloatArray,
    ) -> None:
        """Whether the source sees points, and through what slabs; `unoccluded`, `out` and `normals` are changed in
        place."""
        setting = self.setting
        lane = np.flatnonzero(unoccluded)
        if not setting.transmission:
            if len(lane):
                unoccluded[lane] = ~setting.rays.occluded(setting.source, target[lane], facet[lane])
                self.count(len(lane))
            return
        span = target - setting.source
        reach = np.maximum(lengths(span), 1e-12)
        ray = span / reach[:, None]
        begun = np.zeros(len(unoccluded))
        for depth in range(MAX_SLABS + 1):
            if len(lane) == 0:
                return
            hits = setting.rays.first_hit(setting.source + begun[lane, None] * ray[lane], ray[lane])
            self.count(len(lane))
            at = begun[lane] + hits.distance
            arrived = (hits.facet < 0) | (hits.facet == facet[lane]) | (at > (1.0 - BLIND_GAP) * reach[lane])
            lane, hits, at = lane[~arrived], hits.take(~arrived), at[~arrived]
            open_ = setting.optics.penetrable[hits.object] & (depth < MAX_SLABS)
            unoccluded[lane[~open_]] = False
            lane, hits, at = lane[open_], hits.take(open_), at[open_]
            if len(lane):
                out[lane, depth] = hits.object
                corner = setting.skin.corners[hits.facet]
                across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
                normals[lane, depth] = across / np.maximum(lengths(across), 1e-300)[:, None]
                begun[lane] = at + BLIND_GAP * reach[lane]


class _Found:
    """First hits of `count` rays."""

    def __init__(self, count: int) -> None:
        self.facet = np.full(count, NOTHING, np.int64)
        self.weights = np.zeros((count, 3))
        self.flat = np.zeros((count, 3))


def _up(hits: Hits, row: Index, steps: int) -> Index:
    """Rows of the hits `steps` before."""
    for _ in range(steps):
        row = hits.parent[row]
        if hits.before is not None:
            hits = hits.before
    return row
