"""Ways to a channel, each asked for one instant at a time: the tracer, beams, one sample per pixel, Sionna's paths."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.parallel import one_blas_thread
from rfgen_sionna.pir.pixel_patches import SceneSnapshot, trace_patches
from rfgen_sionna.scene.mitsuba_backend import ensure_backend
from rfgen_sionna.scene.ray_layer import MeshLayer
from rfgen_sionna.tracing.tracer import Tracer
from tests.benchmarks.subjects import Subject
from tests.reference.sbr.shoot import Sampling, shoot

BLOCK = 1 << 24
"""Samples per launch."""


class Method(Protocol):
    """What a row of the benchmark measures."""

    @property
    def row(self) -> dict[str, Any]:
        """What it is called, and its setting."""
        ...

    def __call__(self, t: float) -> complex:
        """Channel of what moves at `t` [s], at the middle of the band."""
        ...

    def returns(self, t: float) -> tuple[ComplexArray, FloatArray]:
        """(path,) gains without the propagation phase, and distances [m]; their sum is the channel."""
        ...


def summed(a: ComplexArray, distance: FloatArray, frequency: float) -> complex:
    """Coherent sum; phases in double precision."""
    return complex((a * np.exp(-2j * np.pi * np.mod(2 * frequency / SPEED_OF_LIGHT * distance, 1.0))).sum())


@dataclass
class Traced:
    """Our tracer, warm: a run that goes on."""

    subject: Subject
    rtol: float
    facets: int = 0
    """What the row says; 0 leaves it out."""

    def __post_init__(self) -> None:
        subject = self.subject
        bounces = subject.max_bounces
        self.tracer = Tracer(subject.scene, subject.radar, subject.actors, self.rtol, max_bounces=bounces)
        self._run = self.tracer.follow()

    @property
    def row(self) -> dict[str, Any]:
        return {"method": "tracer", "rtol": self.rtol} | ({"facets": self.facets} if self.facets else {})

    def __call__(self, t: float) -> complex:
        return summed(*self.returns(t), self.subject.frequency)

    def returns(self, t: float) -> tuple[ComplexArray, FloatArray]:
        paths = self.tracer.trace(t, t, self._run).moving
        chosen = self.subject.counted(paths)
        return paths.a[0, 0, chosen, 0], 0.5 * SPEED_OF_LIGHT * paths.tau[0, 0, chosen, 0]


@dataclass
class Beams:
    """What images (PIRs) are rendered with: a grid of beams that look at the subject, each integrated over a patch."""

    subject: Subject
    pixels: int

    def __post_init__(self) -> None:
        self._tracer = Tracer(self.subject.scene, self.subject.radar, self.subject.actors)
        n, half = self.pixels, self.subject.half_view

        def directions(places: FloatArray) -> FloatArray:
            """(place^2, 3) unit vectors through a grid of the image plane, in cells from its corner."""
            z, y = (each.ravel() for each in np.meshgrid(half - 2 * half * places / n, half - 2 * half * places / n,
                                                         indexing="ij"))  # fmt: skip
            vectors = np.stack([np.ones_like(y), y, z], axis=1)
            vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
            return np.asarray(vectors @ self.subject.radar.rotation.T)

        self._middles, self._corners = directions(np.arange(n) + 0.5), directions(np.arange(n + 1.0))
        first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
        self._corner = np.stack([first, first + 1, first + n + 2, first + n + 1], axis=1)

    @property
    def row(self) -> dict[str, Any]:
        rays = len(self._middles) + len(self._corners)
        return {"method": "beams", "pixels": self.pixels**2, "rays": rays}

    def __call__(self, t: float) -> complex:
        return summed(*self.returns(t), self.subject.frequency)

    @one_blas_thread()
    def returns(self, t: float) -> tuple[ComplexArray, FloatArray]:
        radar = self.subject.radar
        snapshot = SceneSnapshot.of(self._tracer, t, np.asarray(radar.position))
        found = trace_patches(snapshot, radar.tx_field, self._middles, self._corners, self._corner)
        a, distance = found.a, found.distance
        if snapshot.num_static:  # what the room returns is not asked for
            moves = snapshot.rays.first_hit(snapshot.viewpoint, self._middles[found.ray]).object >= snapshot.num_static
            a, distance = a[moves], distance[moves]
        turns = np.mod(2 * self.subject.frequency / SPEED_OF_LIGHT * distance, 1.0)
        return a * np.exp(2j * np.pi * turns), distance


@dataclass
class Tubes:
    """Shooting and bouncing rays in all directions, adaptive ones to a tolerance or uniform ones of a level."""

    subject: Subject
    rtol: float = 1e-2
    level: int | None = None
    """Of uniform tubes; None are adaptive ones."""

    def __post_init__(self) -> None:
        self._tracer = Tracer(self.subject.scene, self.subject.radar, self.subject.actors)
        self._rays = 0

    @property
    def row(self) -> dict[str, Any]:
        setting = {"rtol": self.rtol} if self.level is None else {"level": self.level}
        name = "rays, adaptive" if self.level is None else "rays, uniform"
        return {"method": name} | setting | ({"rays": self._rays} if self._rays else {})

    def __call__(self, t: float) -> complex:
        return summed(*self.returns(t), self.subject.frequency)

    def returns(self, t: float) -> tuple[ComplexArray, FloatArray]:
        sampling: Sampling = "adaptive" if self.level is None else "uniform"
        found = shoot(self._tracer, t, self.subject.max_bounces, self.rtol, sampling, self.level)
        self._rays, paths = found.report.rays, found.paths
        moving = [each.object_id for each in self._tracer.surfaces.moving]  # what the room returns is not asked for
        counted = self.subject.counted(paths)
        chosen = counted[np.isin(paths.object_id[counted], moving)]
        return paths.a[0, 0, chosen, 0], 0.5 * SPEED_OF_LIGHT * paths.tau[0, 0, chosen, 0]


@dataclass
class Samples:
    """One sample per pixel: rays through a grid, (j / 4 pi) exp(-2 j k R) times pixel's solid angle and reflection.

    That is what published simulators do, from their equations: here on one compiled kernel, with the same ray tracer
    and the polarimetric Fresnel coefficients at each hit, so that nothing but the sampling is to blame. `half_view` is
    the tangent of half the field of view.
    """

    subject: Subject
    pixels: int
    jitter: bool = False
    half_view: float | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        ensure_backend()
        self._origin = np.asarray(self.subject.radar.position)
        self._half = self.subject.half_view if self.half_view is None else self.half_view
        self._count = 0

    @property
    def row(self) -> dict[str, Any]:
        name = "one sample per pixel" + (", jittered" if self.jitter else "")
        view = 2 * np.degrees(np.arctan(self._half))
        return {"method": name, "pixels": self.pixels**2, "rays": self.pixels**2, "view_deg": round(float(view), 1)}

    @cached_property
    def _layers(self) -> tuple[MeshLayer | None, MeshLayer]:
        subject = self.subject
        static = [] if subject.scene is None else [(each.vertices, each.faces) for each in subject.scene.objects]
        moving = [(actor.vertices(0.0), actor.faces) for actor in subject.actors]
        return MeshLayer(static, self._origin, False) if static else None, MeshLayer(moving, self._origin, True)

    def __call__(self, t: float) -> complex:
        import drjit as dr

        total = 0j
        for rows in self._blocks(t):
            weight, sin, cos, _ = self._kernel(*rows)
            real, imaginary = dr.sum(weight[0] * cos + weight[1] * sin), dr.sum(weight[1] * cos - weight[0] * sin)
            dr.eval(real, imaginary)
            total += complex(float(real[0]), float(imaginary[0]))
        return 1j / (4 * np.pi) * total

    def returns(self, t: float) -> tuple[ComplexArray, FloatArray]:
        return self.hits(t)[1:]

    def hits(self, t: float) -> tuple[NDArray[np.intp], ComplexArray, FloatArray]:
        """The pixels that hit, ascending, with what they return."""
        found = []
        for first, rows in self._blocks(t):
            weight, _, _, distance = self._kernel(first, rows)
            hit = np.flatnonzero(np.isfinite(distance.numpy()) & (weight[0].numpy() != 0))
            a = weight[0].numpy()[hit].astype(np.float64) + 1j * weight[1].numpy()[hit]
            found.append((first * self.pixels + hit, 1j / (4 * np.pi) * a, distance.numpy()[hit].astype(np.float64)))
        pixels, gains, distances = zip(*found, strict=True)
        return np.concatenate(pixels), np.concatenate(gains), np.concatenate(distances)

    def _blocks(self, t: float) -> list[tuple[int, int]]:
        """First row and number of rows of each launch at `t`."""
        self._layers[1].move(np.concatenate([actor.vertices(t) for actor in self.subject.actors]))
        height = max(1, BLOCK // self.pixels)
        return [(first, min(height, self.pixels - first)) for first in range(0, self.pixels, height)]

    def _kernel(self, first: int, rows: int) -> tuple[tuple[Any, Any], Any, Any, Any]:
        import drjit as dr
        import mitsuba as mi

        subject = self.subject
        static, moving = self._layers
        count, side = rows * self.pixels, dr.opaque(mi.UInt32, self.pixels)
        width = dr.opaque(mi.Float, 2 * self._half / self.pixels)
        index = dr.arange(mi.UInt32, count)
        row = index // side
        column = index - row * side
        places = [mi.Float(row + dr.opaque(mi.UInt32, first)) + 0.5, mi.Float(column) + 0.5]
        if self.jitter:
            self._count += 1
            generator = mi.PCG32(count, dr.opaque(mi.UInt64, 1_000_003 * self.seed + self._count))
            places = [place - 0.5 + generator.next_float32() for place in places]
        half = dr.opaque(mi.Float, self._half)
        y, z = width * places[1] - half, width * places[0] - half
        length = dr.sqrt(1.0 + y * y + z * z)
        axes = [mi.Vector3f(*(dr.opaque(mi.Float, float(x)) for x in axis)) for axis in subject.radar.rotation.T]
        direction = (axes[0] + y * axes[1] + z * axes[2]) / length
        ray = mi.Ray3f(mi.Point3f(0.0), direction)
        found = moving.scene.ray_intersect_preliminary(ray, coherent=True)
        hit = found.is_valid()
        if static is not None:
            nearest = static.scene.ray_intersect_preliminary(ray, coherent=True)
            hit &= ~nearest.is_valid() | (found.t < nearest.t)
        solid = dr.select(hit, width * width / (length * length * length), 0.0)
        strength = self._reflection(found, ray, direction)
        cycles = dr.select(hit, mi.Float64(found.t) * dr.opaque(mi.Float64, 2 * subject.frequency / SPEED_OF_LIGHT), 0)
        sin, cos = dr.sincos(mi.Float(cycles - dr.round(cycles)) * (2 * np.pi))
        distance = dr.select(hit, found.t, dr.inf)
        return (solid * strength[0], solid * strength[1]), sin, cos, distance

    def _reflection(self, found: Any, ray: Any, direction: Any) -> tuple[Any, Any]:
        """(real, imaginary) r_s e_s^2 - r_p e_p^2, which is -1 for metal."""
        import drjit as dr
        import mitsuba as mi

        permittivity = self.subject.permittivity
        if not np.isfinite(permittivity):
            return mi.Float(-1.0), mi.Float(0.0)
        normal = found.compute_surface_interaction(ray, mi.RayFlags.Minimal).n
        eps = mi.Complex2f(dr.opaque(mi.Float, permittivity.real), dr.opaque(mi.Float, permittivity.imag))
        cos = dr.abs(dr.dot(normal, direction))
        root = dr.sqrt(eps - (1 - cos * cos))
        root = dr.select(root.imag > 0, -root, root)
        r_s, r_p = (cos - root) / (cos + root), (eps * cos - root) / (eps * cos + root)
        field = mi.Vector3f(*(dr.opaque(mi.Float, float(x)) for x in self.subject.radar.tx_field))
        s, across = dr.cross(direction, normal), field - dr.dot(field, direction) * direction
        size = dr.maximum(dr.dot(s, s) * dr.dot(across, across), 1e-20)
        share = dr.square(dr.dot(s, across)) / size
        total = r_s * share - r_p * (1 - share)
        return total.real, total.imag


@dataclass
class Lines:
    """One sample per pixel at evenly spaced instants of a frame, and pixel by pixel straight lines between them: what
    tracing every chirp would take is saved, and what a pixel's edge does in between is lost. A pixel that hits at one
    instant alone returns what it does there for as long as that one is nearer."""

    samples: Samples
    sample_times: int
    length: float
    """Of the frame [s]."""

    def __post_init__(self) -> None:
        self._known: dict[int, tuple[NDArray[np.intp], ComplexArray, FloatArray]] = {}

    @property
    def subject(self) -> Subject:
        return self.samples.subject

    @property
    def row(self) -> dict[str, Any]:
        return self.samples.row | {
            "method": "one sample per pixel, lines between instants",
            "instants": self.sample_times,
        }

    def __call__(self, t: float) -> complex:
        return summed(*self.returns(t), self.subject.frequency)

    def returns(self, t: float) -> tuple[ComplexArray, FloatArray]:
        step = self.length / (self.sample_times - 1)
        first = min(int(t / step), self.sample_times - 2)
        share = t / step - first
        self._known = {
            k: self._known[k] if k in self._known else self.samples.hits(k * step) for k in (first, first + 1)
        }
        before, after = self._known[first], self._known[first + 1]
        _, one, two = np.intersect1d(before[0], after[0], assume_unique=True, return_indices=True)
        parts = [tuple((1 - share) * a[one] + share * b[two] for a, b in zip(before[1:], after[1:], strict=True))]
        nearer, both = (before, one) if share < 0.5 else (after, two)
        alone = np.ones(len(nearer[0]), np.bool_)
        alone[both] = False
        parts.append((nearer[1][alone], nearer[2][alone]))
        gains, distances = zip(*parts, strict=True)
        return np.concatenate(gains), np.concatenate(distances)


@dataclass
class SionnaPaths:
    """Sionna's `PathSolver`: specular paths, or with `samples` diffuse ones of a surface that scatters all of it."""

    subject: Subject
    samples: int = 0
    """Rays of the diffuse search; 0 is specular alone."""

    @property
    def row(self) -> dict[str, Any]:
        if self.samples:
            return {"method": "Sionna, diffuse", "rays": self.samples}
        return {"method": "Sionna, specular", "rays": 1_000_000}

    @cached_property
    def _scene(self) -> Any:
        """The subject's meshes as objects of a Sionna scene, with the radar in it."""
        import mitsuba as mi
        import sionna.rt as rt

        from rfgen_sionna.scene import add_radar, load_scene
        from rfgen_sionna.scene.radio_materials import sionna_material

        scene = load_scene(None)
        scene.tune(self.subject.frequency)
        added = []
        for actor in self.subject.actors:
            points, faces = actor.vertices(0.0), actor.faces
            mesh = mi.Mesh(actor.name, len(points), len(faces))
            parameters = mi.traverse(mesh)
            parameters["faces"] = mi.UInt32(faces.ravel().astype(np.uint32))
            parameters["vertex_positions"] = mi.Float(points.ravel().astype(np.float32))
            parameters.update()
            surface = sionna_material("metal", name=f"{actor.name}-material")
            surface.scattering_coefficient = 1.0 if self.samples else 0.0
            added.append(rt.SceneObject(mi_mesh=mesh, name=actor.name, radio_material=surface))
        scene.sionna.edit(add=added)
        add_radar(scene, self.subject.radar)
        return scene

    def __call__(self, t: float) -> complex:
        return summed(*self.returns(t), self.subject.frequency)

    def returns(self, t: float) -> tuple[ComplexArray, FloatArray]:
        import sionna.rt as rt

        from rfgen_sionna.tracing.sionna.sionna_paths import from_sionna

        scene = self._scene.sionna
        for actor in self.subject.actors:
            points = actor.vertices(t)
            scene.get(actor.name).position = 0.5 * (points.min(axis=0) + points.max(axis=0))
        diffuse = bool(self.samples)
        paths = rt.PathSolver()(
            scene, max_depth=self.subject.max_bounces, los=False, refraction=False, specular_reflection=not diffuse,
            diffuse_reflection=diffuse, synthetic_array=False, samples_per_src=self.samples or 1_000_000,
        )  # fmt: skip
        found = from_sionna(paths, self.subject.radar)
        return found.a[0, 0, :, 0], 0.5 * SPEED_OF_LIGHT * found.tau[0, 0, :, 0]
