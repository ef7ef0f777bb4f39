"""Plane mirrors on the legs of facets, as lanes of the integration kernel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.kernels import upload
from rfgen_sionna.tracing.integral.obliquity import Media, Medium, media_of_lanes, media_tables


class MirrorPlanes(NamedTuple):
    """Planes of mirrors."""

    normal: FloatArray
    """(mirror, 3) unit vectors."""
    offset: FloatArray
    """(mirror,) normal . x of the mirror's points [m], in the frame of the nodes."""
    media: Media
    """One material per mirror."""


@dataclass(frozen=True)
class MirrorLegs:
    """Mirrors on the legs to and from each facet."""

    mirrors: MirrorPlanes
    """Mirrors next to the facets."""
    before: MirrorPlanes | None
    """Mirror between the elements and each of `mirrors`; None means one mirror per leg."""
    tx: IntArray | None
    """(facet,) index of the mirror on the leg from Tx; None means a direct leg."""
    rx: IntArray | None
    """(facet,) index of the mirror on the leg to Rx; None means a direct leg."""


class MirrorLanes(NamedTuple):
    """Mirror of each lane, and the mirror before it as seen from the elements, if any."""

    normal: Any
    offset: Any
    medium: Medium
    before: MirrorLanes | None = None

    def image(self, dr: Any, point: Any) -> Any:
        """Image of an element's position."""
        if self.before is not None:
            point = self.before.image(dr, point)
        return point - 2.0 * (dr.dot(point, self.normal) - self.offset) * self.normal

    def turned(self, dr: Any, field: Any) -> Any:
        """Image of a direction."""
        if self.before is not None:
            field = self.before.turned(dr, field)
        return field - 2.0 * dr.dot(field, self.normal) * self.normal

    def surfaces(self, dr: Any) -> list[tuple[Any, Medium]]:
        """Normals in the image's frame and media of the reflecting surfaces, in order from the element."""
        own = [(self.normal, self.medium)]
        if self.before is None:
            return own
        first = self.before.normal
        return [(first - 2.0 * dr.dot(first, self.normal) * self.normal, self.before.medium), *own]


def mirror_tables(dr: Any, types: Any, via: MirrorLegs) -> dict[str, Any]:
    """Arrays of `via` on the device, for :func:`mirrors_of_lanes`."""
    Float, UInt32 = types.Float64, types.UInt32

    def table(planes: MirrorPlanes) -> dict[str, Any]:
        return {
            "normal": upload(Float, planes.normal),
            "offset": upload(Float, planes.offset),
            "media": media_tables(dr, types, planes.media),
        }

    found = {"mirrors": table(via.mirrors)}
    if via.before is not None:
        found["before"] = table(via.before)
    ways = {"tx": via.tx, "rx": via.rx}
    return found | {name: upload(UInt32, np.asarray(way, np.uint32)) for name, way in ways.items() if way is not None}


def mirrors_of_lanes(
    dr: Any, types: Any, via: dict[str, Any], facet: Any, node: Any, wavenumber: Any
) -> tuple[MirrorLanes | None, MirrorLanes | None]:
    """Mirrors of Tx and Rx per lane; None means a direct leg."""

    def wall(way: str) -> MirrorLanes | None:
        if way not in via:
            return None
        mirror = dr.gather(types.UInt32, via[way], facet)

        def of(planes: dict[str, Any], before: MirrorLanes | None) -> MirrorLanes:
            normal = (dr.gather(types.Float64, planes["normal"], mirror * 3 + axis) for axis in range(3))
            offset = dr.gather(types.Float64, planes["offset"], mirror)
            medium = media_of_lanes(dr, types, planes["media"], node, mirror, wavenumber)
            return MirrorLanes(types.Array3f64(*normal), offset, medium, before)

        return of(via["mirrors"], of(via["before"], None) if "before" in via else None)

    return wall("tx"), wall("rx")
