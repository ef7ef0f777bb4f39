"""Drafts of surroundings: an empty box of a room, or a ground with walls, that drawing starts from.

A small network finds furniture and textures sooner than it finds that walls are flat and where the floor lies, which
follows from the view. So an image begins as a box with noise on it: distances of the walls, height and brightness are
those that training views of such a place were measured to have, taken together at random. What is drawn near to a
surface of the box is taken for that surface, with a remainder of noise on it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from rfgen_sionna.generative.environment.views import NATIVE
from rfgen_sionna.pir.codec import PirCodec
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import SPEED_OF_LIGHT, FloatArray

if TYPE_CHECKING:
    from rfgen_sionna.generative.environment.corpus import Corpus
    from rfgen_sionna.generative.environment.text import ViewFacts

FLOOR, WALL, CEILING = range(3)
COSINES = 8
"""Bins of the cosine of incidence in which brightness is kept."""
_SIDES = ((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0))
"""Axis and direction of each wall."""
_FACING = 0.25
"""Least component of a direction towards a wall for what lies there to tell of it."""
_ENOUGH = 60
"""Pixels that a wall, or a ceiling, shows at least."""
_FLAT = 0.03
"""What counts as one plane: relative to the distance."""
_ON_FLOOR = 0.05
"""Height up to which a point is floor [m]."""
_SHAKEN = 0.06
"""Spread by which distances are changed, relative: no room is one of the training set."""
_ALIKE = 24
"""Training views, the nearest by direction, among which one is chosen."""
_LOW = 0.85
"""Of the median height: what is lower is no ceiling."""
_FARTHEST = 110.0
_NEAREST = 0.4
"""Distances of a wall [m]: nobody walks into one."""
SAME = (0.10, 0.06)
"""Differences of the channels of energy and range, in −1 … 1, within which a drawn pixel is taken for the draft's
surface: 6.5 dB, and about a tenth of range plus 3 m."""
_PATCH = 1.2
"""Spread of the surroundings of a pixel that decide on it [pixels]."""


@dataclass(frozen=True)
class Drafts:
    """What boxes are made of, for each place."""

    places: NDArray[np.intp]
    """(row,) place of a training view."""
    yaw: FloatArray
    """(row,) of the view [rad]."""
    boxes: FloatArray
    """(row, 5) distances of the walls at +x, -x, +y and -y from the radar, and height of ceiling or walls [m]; NaN
    where none was seen."""
    offsets: FloatArray
    """(row, 3) how much brighter floor, walls and ceiling are than the place's mean [dB]; NaN where none was seen."""
    levels: FloatArray
    """(place, 3, COSINES) mean brightness [dB]: energy per solid angle at 1 m."""
    roofed: NDArray[np.bool_]
    """(place,) whether it has a ceiling."""

    @classmethod
    def fit(cls, corpus: Corpus, codec: PirCodec) -> Drafts:
        """From training views."""
        boxes, parts = [], []
        for index, facts in enumerate(corpus.views):
            energy, arrival, _ = codec.decode_arrays(corpus.images[index].astype(np.float64), clip=True)
            reach = 0.5 * SPEED_OF_LIGHT * arrival
            rays = _view(facts).directions
            box = _measured(reach[..., None] * rays, rays, facts.height)
            boxes.append(box)
            parts.append(_brightness(energy, reach, rays, facts, box))
        count = len(corpus.names)
        found = np.array(boxes)
        sums, seen = np.zeros((count, 3, COSINES)), np.zeros((count, 3, COSINES))
        for place, (kind, bin_, bright) in zip(corpus.places, parts, strict=True):
            np.add.at(sums[place], (kind, bin_), bright)
            np.add.at(seen[place], (kind, bin_), 1.0)
        levels = _filled(np.where(seen >= 100, sums / np.maximum(seen, 1.0), np.nan))
        offsets = np.full((len(parts), 3), np.nan)
        for row, (place, (kind, bin_, bright)) in enumerate(zip(corpus.places, parts, strict=True)):
            rest = bright - levels[place, kind, bin_]
            for k in range(3):
                if (kind == k).sum() >= _ENOUGH:
                    offsets[row, k] = rest[kind == k].mean()
        for p in np.unique(corpus.places):  # a cupboard is no ceiling, and one dark picture is no wall
            here = np.flatnonzero(corpus.places == p)
            low = found[here, 4] < _LOW * np.nanmedian(found[here, 4]) if np.isfinite(found[here, 4]).any() else []
            found[here[low], 4] = np.nan
            for k in range(3):
                if len(known := offsets[here, k][np.isfinite(offsets[here, k])]):
                    offsets[here, k] = np.clip(offsets[here, k], *np.quantile(known, [0.05, 0.95]))
        roofed = np.array([np.isfinite(found[corpus.places == p, 4]).mean() > 0.5 if p in corpus.places else True
                           for p in range(count)])  # fmt: skip
        outside = np.array([_OUTDOORS.get(name, False) for name in corpus.names])
        return cls(
            np.asarray(corpus.places),
            np.array([v.yaw for v in corpus.views]),
            found,
            offsets,
            levels,
            roofed & ~outside,
        )

    def draw(
        self,
        place: int,
        facts: ViewFacts,
        codec: PirCodec,
        seed: int,
        *,
        first: ViewFacts | None = None,
        moved: tuple[float, float] = (0.0, 0.0),
    ) -> NDArray[np.float32]:
        """(3, row, column) channels of an empty place.

        Args:
            place: index of the place.
            facts: how it is seen.
            codec: convention of the channels.
            seed: of the box.
            first: how this place was seen first, where this is another view of it.
            moved: from there to here [m].
        """
        rng = np.random.default_rng([seed, 101])
        here = np.flatnonzero(self.places == place)
        first = first or facts
        near = here[np.argsort(np.cos(self.yaw[here] - first.yaw))[::-1][:_ALIKE]]
        box, offset = (self._chosen(values, rng.permutation(near), here, rng) for values in (self.boxes, self.offsets))
        box = box * np.exp(_SHAKEN * rng.standard_normal(5))
        roofed = bool(self.roofed[place])
        if roofed:
            box[4] = max(box[4], first.height + 0.3)
        for k, (axis, sign) in enumerate(_SIDES):
            if np.isfinite(box[k]):
                box[k] = max(box[k] - sign * moved[axis], _NEAREST)
        rays = _view(facts).directions
        reach, kind, cosine = _cast(box, rays, facts.height, roofed)
        there = np.isfinite(reach)
        at = np.clip(cosine * COSINES - 0.5, 0, COSINES - 1)
        low = np.floor(at).astype(np.intp)
        table = self.levels[place]
        high = np.minimum(low + 1, COSINES - 1)
        level = table[kind, low] + (at - low) * (table[kind, high] - table[kind, low]) + offset[kind]
        level = level - 20 * np.log10(np.where(there, reach, 1.0)) + _solid_angle(facts)
        energy = np.where(there, 10 ** (level / 10), 0.0)
        return codec.encode_arrays(energy, 2 / SPEED_OF_LIGHT * reach, np.zeros(reach.shape), clip=True)

    @property
    def tables(self) -> dict[str, FloatArray]:
        """Everything, for a file."""
        return {field.name: np.asarray(getattr(self, field.name), dtype=np.float64) for field in fields(self)}

    @classmethod
    def of(cls, tables: Mapping[str, FloatArray]) -> Drafts:
        """From what a file holds."""
        whole = {"places": np.intp, "roofed": np.bool_}
        return cls(**{name: np.asarray(x).astype(whole.get(name, np.float64)) for name, x in tables.items()})

    @staticmethod
    def _chosen(
        values: FloatArray, near: NDArray[np.intp], here: NDArray[np.intp], rng: np.random.Generator
    ) -> FloatArray:
        """One row of `near`; what it lacks is another row's, or the place's if hardly any has it."""
        row = np.array(values[near[0]])
        for k in np.flatnonzero(np.isnan(row)).tolist():
            known = values[here, k][np.isfinite(values[here, k])]
            # A wall that hardly any view shows is out of sight.
            row[k] = float(rng.choice(known)) if len(known) > 0.02 * len(here) else 0.0 if k < 3 else np.nan
        return row


_OUTDOORS = {"street": True, "playground": True, "open field": True}


def settled(drawn: NDArray[np.floating], draft: NDArray[np.floating]) -> FloatArray:
    """Drawn images (image, 3, row, column) in which what lies near the surfaces of a draft lies on them."""
    out = np.array(drawn, dtype=np.float64)
    apart = out[:, :2] - draft[:, :2]
    size = np.sum((apart / np.array(SAME)[:, None, None]) ** 2, axis=1)
    size = gaussian_filter(size, (0.0, _PATCH, _PATCH))
    own = (size**2 / (size**2 + 1.0))[:, None]
    out[:, :2] = draft[:, :2] + own * apart
    out[:, 2] = np.where(own[:, 0] > 0.5, out[:, 2], draft[:, 2])
    return out


def _view(facts: ViewFacts) -> View:
    return View(NATIVE, facts.fov_deg, (0.0, 0.0, facts.height), (facts.yaw, facts.pitch, facts.roll))


def _solid_angle(facts: ViewFacts) -> FloatArray:
    """(row, column) of the pixels [dB steradian]."""
    half = np.tan(np.radians(facts.fov_deg) / 2)
    rows, columns = NATIVE
    y = half[0] * (1 - (2 * np.arange(columns) + 1) / columns)
    z = half[1] * (1 - (2 * np.arange(rows) + 1) / rows)
    stretch = (1 + y[None, :] ** 2 + z[:, None] ** 2) ** -1.5
    return np.asarray(10 * np.log10(4 * half[0] * half[1] / (rows * columns) * stretch))


def _measured(points: FloatArray, rays: FloatArray, height: float) -> FloatArray:
    """(5,) distances of walls and the height above, from points (row, column, 3) relative to the radar."""
    out = np.full(5, np.nan)
    z = height + points[..., 2]
    over = z[(rays[..., 2] > 0.1) & np.isfinite(z)]
    if len(over) >= _ENOUGH:
        top = float(np.quantile(over, 0.9))
        flat = np.abs(over - top) < _FLAT * max(top, 1.0)
        if flat.sum() >= _ENOUGH and flat.mean() > 0.25:
            out[4] = float(np.median(over[flat]))
    upright = np.isfinite(z) & (z > 2 * _ON_FLOOR) & ~(np.abs(z - out[4]) < 0.1)
    for k, (axis, sign) in enumerate(_SIDES):
        facing = upright & (sign * rays[..., axis] > _FACING)
        away = (sign * points[..., axis])[facing]
        if len(away) < _ENOUGH:
            continue
        far = float(np.quantile(away, 0.9))
        flat = np.abs(away - far) < _FLAT * far
        if flat.sum() >= _ENOUGH:
            out[k] = float(np.median(away[flat]))
            if np.isnan(out[4]):
                continue
    if np.isnan(out[4]):  # under the sky: how high what stands at the sides is
        tops = [
            float(np.quantile(z[upright][flat], 0.9))
            for k, (axis, sign) in enumerate(_SIDES)
            if np.isfinite(out[k])
            and (flat := np.abs(sign * points[..., axis][upright] - out[k]) < _FLAT * out[k]).sum() >= _ENOUGH
        ]
        if tops:
            out[4] = max(tops)
    return out


def _brightness(
    energy: FloatArray, reach: FloatArray, rays: FloatArray, facts: ViewFacts, box: FloatArray
) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]:
    """Kind of surface, bin of incidence, and brightness [dB] of the pixels that lie on the box."""
    expected, kind, cosine = _cast(box, rays, facts.height, bool(np.isfinite(box[4])))
    with np.errstate(invalid="ignore"):
        on = (energy > 0) & (np.abs(reach - expected) < _FLAT * expected)
    bright = 10 * np.log10(energy[on]) + 20 * np.log10(reach[on]) - _solid_angle(facts)[on]
    return kind[on], np.minimum((cosine[on] * COSINES).astype(np.intp), COSINES - 1), bright


def _cast(
    box: FloatArray, rays: FloatArray, height: float, roofed: bool
) -> tuple[FloatArray, NDArray[np.intp], FloatArray]:
    """Range [m] of what each ray (row, column, 3) meets, NaN for nothing, which kind of surface that is, and the cosine
    of incidence."""
    best = np.full(rays.shape[:2], np.inf)
    kind, cosine = np.zeros(best.shape, np.intp), np.zeros(best.shape)

    def meet(component: FloatArray, distance: float, which: int, highest: float = np.inf) -> None:
        nonlocal best
        if not (np.isfinite(distance) and distance > 0):
            return
        reach = np.where(component > 1e-6, distance / np.maximum(component, 1e-6), np.inf)
        nearer = (reach < best) & (reach < _FARTHEST) & (height + reach * rays[..., 2] < highest)
        best = np.where(nearer, reach, best)
        kind[nearer], cosine[nearer] = which, component[nearer]

    meet(-rays[..., 2], height, FLOOR)
    if roofed:
        meet(rays[..., 2], box[4] - height, CEILING)
    for distance, (axis, sign) in zip(box[:4].tolist(), _SIDES, strict=True):
        meet(sign * rays[..., axis], distance, WALL, np.inf if roofed else float(np.nan_to_num(box[4])))
    return np.where(np.isfinite(best), best, np.nan), kind, cosine


def _filled(levels: FloatArray) -> FloatArray:
    """(place, kind, bin) levels without gaps: from the nearest bin, else from the mean of the other places."""
    out = levels.copy()
    for place in range(len(out)):
        for kind in range(out.shape[1]):
            row = out[place, kind]
            known = np.flatnonzero(np.isfinite(row))
            if len(known):
                out[place, kind] = row[known[np.abs(np.arange(len(row))[:, None] - known).argmin(axis=1)]]
    for kind in range(out.shape[1]):
        empty = np.isnan(out[:, kind, 0])
        out[empty, kind] = out[~empty, kind].mean(axis=0) if (~empty).any() else -30.0
    return out
