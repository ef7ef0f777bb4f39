"""What each skip of the tracer saves, and that the answer stays within the tolerance without it.

A skip is turned off where it is made, by replacing the function or number that makes it. The answer is the ADC frame of
an adult in the living room, 12 channels, in two parts that are compared each by itself: what the room returns with the
adult's shadow, and what the adult returns.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import Any
from unittest import mock

import numpy as np

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import SPEED_OF_LIGHT, ComplexArray
from rfgen_sionna.scene import Actor, load_scene
from rfgen_sionna.signal import synthesize
from rfgen_sionna.tracing import bounces, gains, ghosts, moving, static, tracer, visibility
from rfgen_sionna.tracing import sampling as sampling_of
from tests.benchmarks.measuring import timed
from tests.benchmarks.subjects import standing

RTOL = 1e-3


@dataclass(frozen=True)
class Skip:
    """One of them."""

    name: str
    off: Callable[[], Any]
    """Context manager within which it is off."""
    max_bounces: int = 1
    anew: bool = False
    """Whether off means that nothing is kept from one frame to the next."""
    far: bool = False
    """Whether it is shown in a street instead of the living room."""


def _patched(*targets: tuple[Any, str, Any]) -> Callable[[], Any]:
    @contextmanager
    def within() -> Iterator[None]:
        with ExitStack() as stack:
            for owner, name, value in targets:
                stack.enter_context(mock.patch.object(owner, name, value))
            yield

    return within


def _open_surfaces(*arguments: Any) -> Any:
    found = _COLLECT(*arguments)
    return replace(found, moving=tuple(replace(each, closed=False) for each in found.moving))


def _all_rays(rays: Any, viewpoint: Any, corners: Any, facet: Any) -> Any:
    through = visibility._through(rays, viewpoint, corners, facet, visibility.FINE)
    guides = visibility._through(rays, viewpoint, corners, facet, visibility.GUIDE)
    count = (len(visibility.FINE) + len(visibility.GUIDE)) * len(corners)
    return visibility.Visibility(through.mean(axis=1), guides, count)


def _all_samples(rays: Any, viewpoint: Any, corners: Any, facet: Any, *_: Any) -> Any:
    seen = _all_rays(rays, viewpoint, corners, facet)
    return seen.fraction, len(visibility.FINE) * len(corners)


_COLLECT = tracer.collect_surfaces
_EVERYWHERE = (gains.BandTracer, "importance", lambda self, direction: np.ones(direction.shape[:-1]))
_BEHIND = (static.StaticTrace, "_behind", lambda self, actors: np.ones(len(self.facets), dtype=np.bool_))
_FACING = (tracer, "collect_surfaces", _open_surfaces)
_PAIRS = (gains, "MONOSTATIC", 0.0)
_RAYS = ((moving, "sampled_fraction", _all_samples), (static, "visible_fraction", _all_rays))
_ENERGY = ((ghosts, "SKIPPED", 0.0), (bounces, "SKIPPED", 0.0))

SKIPS = (
    Skip("static parts are traced once", _patched(), anew=True),
    Skip("static facets are tested anew only behind actors", _patched(_BEHIND)),
    Skip("facets that look away", _patched(_FACING)),
    Skip("coarse facets outside the antenna pattern", _patched(_EVERYWHERE), anew=True),
    Skip("more visibility rays only where neighbours differ and it matters", _patched(*_RAYS), anew=True),
    Skip("one obliquity for a short baseline", _patched(_PAIRS), anew=True),
    Skip("bounces under the tolerance", _patched(*_ENERGY), max_bounces=3),
    Skip("outside the range window", _patched(), anew=True, far=True),
    Skip("all but bounces and window", _patched(_BEHIND, _FACING, _EVERYWHERE, _PAIRS, *_RAYS), anew=True),
)


def _setting() -> tuple[Radar, Any, Actor]:
    radar = Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    scene = load_scene("living_room")
    scene.tune(radar.center_frequency)
    mesh = standing()
    person = Actor.from_mesh((mesh.vertices(0.0), mesh.faces), material="skin", position=(3, 0, 0),
                             orientation=(np.pi, 0, 0), velocity=(-0.5, 0, 0), name="person")  # fmt: skip
    return radar, scene, person


class _Run:
    """A run of frames, a static scene kept or not."""

    def __init__(self, radar: Radar, scene: Any, actor: Actor, max_bounces: int) -> None:
        self._make = lambda: tracer.Tracer(scene, radar, [actor], RTOL, max_bounces=max_bounces)
        self._radar, self._tracer = radar, self._make()
        self._moving = self._tracer.follow()

    def frame(self, index: int, anew: bool) -> tracer.Traced:
        if anew:
            self._tracer = self._make()
            self._moving = self._tracer.follow()
        wave = self._radar.waveform
        start = index * wave.frame_period
        return self._tracer.trace(start, start + wave.frame_length, self._moving)

    def answer(self, traced: tracer.Traced, start: float) -> tuple[ComplexArray, ComplexArray]:
        still = synthesize(self._radar, traced.static, 0.0, eps=0.3 * RTOL, device="cpu")
        if traced.shadow.num_paths:
            still = still + synthesize(self._radar, traced.shadow, start, eps=0.3 * RTOL, device="cpu")
        return still, synthesize(self._radar, traced.moving, start, eps=0.3 * RTOL, device="cpu")


def _difference(found: ComplexArray, expected: ComplexArray) -> float:
    return float(np.linalg.norm(found - expected) / max(np.linalg.norm(expected), 1e-300))


def row(skip: Skip, repeats: int = 2) -> dict[str, Any]:
    """Time of a warm frame with and without one skip, side by side, and the difference of their answers."""
    if skip.far:
        return _window_row()
    radar, scene, actor = _setting()
    run = _Run(radar, scene, actor, skip.max_bounces)
    run.frame(0, False)
    with skip.off():
        other = _Run(radar, scene, actor, skip.max_bounces)
        other.frame(0, False)
    on, off = [], []
    for index in range(1, 1 + repeats):
        # With anything that a static scene keeps, what is compared is a frame that begins with nothing kept.
        fresh = skip.anew and skip.name != SKIPS[0].name
        elapsed, here = timed(lambda index=index, fresh=fresh: run.frame(index, fresh))
        on.append(elapsed)
        with skip.off():
            elapsed, there = timed(lambda index=index: other.frame(index, skip.anew))
        off.append(elapsed)
    start = repeats * radar.waveform.frame_period
    ours, theirs = run.answer(here, start), run.answer(there, start)
    return {
        "skip": skip.name, "seconds_on": min(on), "seconds_off": min(off), "times_faster": min(off) / min(on),
        "facets_on": here.report.facets, "facets_off": there.report.facets, "rays_on": here.report.rays,
        "rays_off": there.report.rays, "difference_room": _difference(ours[0], theirs[0]),
        "difference_actor": _difference(ours[1], theirs[1]), "allowed": RTOL,
    }  # fmt: skip


def _window_row() -> dict[str, Any]:
    """A street canyon: within the window both have the same paths; what is beyond it is the IF filter's to remove."""
    radar = Radar.load("awr1843", "mmmesh", position=(0.0, 0.0, 1.5), look_at=(10.0, 4.0, 1.5))
    scene = load_scene("simple_street_canyon")
    scene.tune(radar.center_frequency)
    wide = replace(radar, waveform=replace(radar.waveform, range_limit=5 * radar.max_range))
    seconds, found = [], []
    for each in (radar, wide):
        elapsed, made = timed(lambda each=each: tracer.Tracer(scene, each, [], 1e-2).static)
        near = np.flatnonzero(made.paths.range[:, 0] < 0.98 * radar.max_range)
        seconds.append(elapsed)
        found.append((made, synthesize(radar, made.paths.select(near), 0.0, eps=1e-6, device="cpu")[0]))
    return {
        "skip": "outside the range window", "seconds_on": seconds[0], "seconds_off": seconds[1],
        "times_faster": seconds[1] / seconds[0], "facets_on": len(found[0][0].facets),
        "facets_off": len(found[1][0].facets), "difference_room": _difference(found[0][1], found[1][1]),
        "difference_actor": 0.0, "allowed": 1e-2,
    }  # fmt: skip


def imports() -> dict[str, Any]:
    """No import before its use: what importing the package takes in a process of its own, and what it leaves out."""
    code = (
        "import time, sys; b = time.perf_counter(); import rfgen_sionna; e = time.perf_counter() - b;"
        "print(e, [m for m in ('torch', 'mitsuba', 'drjit', 'sionna', 'diffusers', 'anny') if m in sys.modules])"
    )
    text = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split(" ", 1)
        for _ in range(3)
    ]
    return {"seconds": min(float(each[0]) for each in text), "imported": text[0][1].strip()}


def run(quick: bool, progress: Callable[[str], None]) -> dict[str, Any]:
    rows = []
    for skip in SKIPS if not quick else (SKIPS[1], SKIPS[2], SKIPS[4]):
        progress(f"skip: {skip.name}")
        rows.append(row(skip, 1 if quick else 2))
    progress("skip: imports")
    return {"rows": rows, "imports": imports()}


def sampling(quick: bool, progress: Callable[[str], None]) -> dict[str, Any]:
    """RF adaptive sampling of visibility: error of an adult's return against the rays sent, uniform or adaptive.

    Uniform are n^2 rays to each facet; adaptive one, and the more where neighbours disagree the more a facet may return.
    Truth is a lattice so dense that each facet is known to a few tenths of a percent.
    """
    from tests.benchmarks.subjects import person

    progress("adaptive sampling of visibility")
    subject = person(77)
    made = tracer.Tracer(None, subject.radar, subject.actors, RTOL)
    run = made.follow()
    paths = made.trace(0.0, 0.0, run)
    rays, vertices, _ = made.geometry(0.0)
    viewpoint = np.asarray(subject.radar.position)
    surface = made.surfaces.moving[0]
    corners = vertices[0][surface.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = np.flatnonzero(((corners[:, 0] - viewpoint) * cross).sum(axis=1) < 0)
    corners, number = corners[facing], facing + surface.first_facet
    band = gains.BandTracer(subject.radar, RTOL)
    facets = moving.stack_facets(made.surfaces.moving, _whole(len(surface.faces)), vertices, viewpoint).take(facing)
    values = band.at_probes(facets, (surface.material,), np.zeros(1), (0, 0), np.full(len(facets), 4, np.int32))
    fields = values.a[0] * np.exp(-2j * np.pi * np.mod(band.centre * values.tau[0], 1.0))

    def lattice(n: int) -> np.ndarray:
        return visibility._through(rays, viewpoint, corners, number, visibility.lattice(n)).mean(axis=1)

    truth = (fields * lattice(12 if quick else 24)).sum()
    rows = []
    for n in (1, 2, 4, 8):
        elapsed, share = timed(lambda n=n: lattice(n))
        error = abs((fields * share).sum() - truth) / abs(truth)
        rows.append({"method": "uniform", "rays": n * n * len(corners), "relative": error, "seconds": elapsed})
    places, wavenumber = sampling_of.touching(corners), 2 * np.pi * band.highest / SPEED_OF_LIGHT
    for rtol in (3e-2, 1e-2, 3e-3, 1e-3):
        elapsed, (share, sent) = timed(
            lambda rtol=rtol: sampling_of.sampled_fraction(rays, viewpoint, corners, number, places, wavenumber, rtol)
        )
        error = abs((fields * share).sum() - truth) / abs(truth)
        rows.append({"method": f"adaptive, rtol {rtol:g}", "rays": sent, "relative": error, "seconds": elapsed})
    return {"facets": len(corners), "rays_of_an_instant": paths.report.rays, "rows": rows}


def _whole(count: int) -> list[Any]:
    """Each face as one facet."""
    from rfgen_sionna.tracing.tessellate import Tessellation

    eye = np.broadcast_to(np.eye(3), (count, 3, 3))
    return [Tessellation(np.arange(count, dtype=np.int32), eye, np.ones(count, np.int32))]
