"""What each skip of the tracer saves, and that the answer stays within the tolerance without it.

A skip is turned off where it is made, by replacing the function or number that makes it. The answer is the ADC frame of
an adult in the living room, 12 channels, in two parts that are compared each by itself: what the room returns with the
adult's shadow, and what the adult returns. Where a skip is about something else, its row says what is shown.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import cache
from typing import Any
from unittest import mock

import numpy as np
from rfgen_sionna.tracing.ghosts import ghosts
from rfgen_sionna.tracing.moving import moving_visibility as sight
from rfgen_sionna.tracing.moving import sample_times as instants
from rfgen_sionna.tracing.reflectors import planar_reflections as bounces
from rfgen_sionna.tracing.transmission import transmission as veils

from rfgen_sionna._types import ComplexArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor, load_scene
from rfgen_sionna.signal import synthesize
from rfgen_sionna.tracing import tracer
from rfgen_sionna.tracing.gains import band as gains
from rfgen_sionna.tracing.shadows import adaptive_sampling as sampling
from rfgen_sionna.tracing.shadows import mirror_visibility as visibility
from rfgen_sionna.tracing.shadows import visible_polygons as shadow_lines
from rfgen_sionna.tracing.shadows.lattices import points_of
from rfgen_sionna.tracing.static import static_facets
from rfgen_sionna.tracing.static import static_reflections as static_bounces
from rfgen_sionna.tracing.static import static_trace as static
from rfgen_sionna.tracing.surface import tessellate
from tests.benchmarks.measuring import default_rtol, timed
from tests.benchmarks.subjects import SPEED, ball, standing

LOOSE = 1e-2
"""Tolerance of rows in which only ratios matter and both sides do the same to the bit."""


@dataclass(frozen=True)
class Skip:
    """One of them, in the living room with an adult."""

    name: str
    off: Callable[[], Any]
    """Context manager within which it is off."""
    anew: bool = False
    """Whether it acts on what is kept from one frame to the next: frames that begin with nothing kept are compared."""
    room: bool = True
    """Whether the room is there; else free space."""
    transmission: bool = False
    max_bounces: int = 1
    rtol: float | None = None
    """At which it acts; None is the default."""

    @property
    def allowed(self) -> float:
        return default_rtol() if self.rtol is None else self.rtol


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
    opened = (replace(each, closed=False, outward=np.zeros_like(each.outward)) for each in found.moving)
    return replace(found, moving=tuple(opened))


def uniform_share(rays: Any, viewpoint: Any, corners: Any, facet: Any, n: int = 8) -> tuple[Any, int]:
    """(facet,) visible share by n^2 rays to each, and the number of rays."""
    places = visibility.barycentric_lattice(n)
    of, every = np.repeat(np.arange(len(corners)), len(places)), np.tile(places, (len(corners), 1))
    through = rays.targets(viewpoint, corners, facet).visible(of, every).reshape(len(corners), -1)
    return through.mean(axis=1), through.size


_SAMPLED = sampling.sample_visibility


def _all_rays(
    rays: Any, viewpoint: Any, corners: Any, facet: Any, visible: Any, wavenumber: float, *more: Any, **others: Any
) -> Any:
    """Rays to all facets: those that would have some get these, others a lattice of more cells the more wavelengths lie
    along them, four at least."""
    found = _SAMPLED(rays, viewpoint, corners, facet, visible, wavenumber, *more, **others)
    rest = np.setdiff1d(np.arange(len(corners)), found.owner)
    _, _, width = sampling.max_returns(corners[rest] - viewpoint, wavenumber)
    level = np.maximum(np.searchsorted(shadow_lines.SPACINGS[:-1], np.sqrt(width)), 2)
    moving, fraction = others.get("moving", False), found.fraction.copy()
    targets = rays.targets(viewpoint, corners[rest], facet[rest], moving)
    more_there = shadow_lines.crossed_by_edges(targets, level, fraction[rest] > 0)
    rays_there = int(points_of(level).sum())
    rest, level, width = rest[more_there], level[more_there], width[more_there]
    unoccluded = shadow_lines.find_visible_polygons(
        rays.targets(viewpoint, corners[rest], facet[rest], moving), level, width
    )
    fraction[rest] = unoccluded.fraction
    owner = np.concatenate([found.owner, rest[unoccluded.owner]])
    pieces = np.concatenate([found.pieces, unoccluded.pieces])
    occluder = np.concatenate(
        [found.occluder, np.column_stack([unoccluded.occluder, np.tile([np.inf, np.nan], (len(unoccluded.owner), 1))])]
    )
    order = np.argsort(owner, kind="stable")
    cut = {"owner": owner[order], "pieces": pieces[order], "occluder": occluder[order]}
    return found._replace(fraction=fraction, rays=found.rays + rays_there + unoccluded.rays, **cut)


def _everything(_around: Any, _viewpoint: Any, _actors: Any) -> Any:
    return np.ones(len(_around[1]), dtype=np.bool_)


_COLLECT = tracer.collect_surfaces
_DEMAND = tessellate.required_splits


def _as_in_the_beam(
    corners: Any, viewpoint: Any, frequency: float, rtol: float, pattern_gain: Any, *more: Any
) -> tuple[Any, Any, Any]:
    """What is demanded of facets, as if the antennas sent as much everywhere, and as their gain asks for."""
    given = [_DEMAND(corners, viewpoint, frequency, rtol, gain, *more) for gain in (pattern_gain, _everywhere)]
    (coarse, parts, high), (coarse_too, *finer) = given
    return coarse | coarse_too, np.maximum(parts, finer[0]), np.maximum(high, finer[1])


def _everywhere(places: Any) -> Any:
    return np.ones(places.shape[:-1])


_EVERYWHERE = (tessellate, "required_splits", _as_in_the_beam)
_BEHIND = (static, "in_shadow_cones", _everything)
_FACING = (tracer, "collect_surfaces", _open_surfaces)
_PAIRS = (gains, "MONOSTATIC", 0.0)
_RAYS = tuple((module, "sample_visibility", _all_rays) for module in (sight, static, static_facets))
_ENERGY = ((ghosts, "OMITTED_SHARE", 0.0), (bounces, "OMITTED_SHARE", 0.0), (static_bounces, "OMITTED_SHARE", 0.0))
_FAINT = (sight, "CULLED_PER_RTOL", 0.0)
_PAIR = (instants, "PAIR_SPACING", 0.0)
_VEILS = (veils.Transmission, "any_transmission", lambda self, only=None, one_way=False: True)

SKIPS = (
    Skip("static parts are traced once", _patched()),
    Skip("static facets are tested anew only behind actors", _patched(_BEHIND)),
    Skip("facets that look away", _patched(_FACING)),
    Skip("coarse facets outside the antenna pattern", _patched(_EVERYWHERE), anew=True),
    Skip("more visibility rays only where neighbours differ", _patched(*_RAYS), anew=True),
    Skip("one obliquity for a short baseline", _patched(_PAIRS)),
    Skip("no transmission where nothing is penetrable", _patched(_VEILS), room=False, transmission=True),
    Skip("facets that return next to nothing", _patched(_FAINT), room=False, rtol=0.1),
    Skip("a third instant where hardly a shadow moves", _patched(_PAIR), room=False, rtol=LOOSE),
    Skip("all of these", _patched(_BEHIND, _FACING, _EVERYWHERE, _PAIRS, *_RAYS, _FAINT, _PAIR, _VEILS), anew=True),
)
ONCE = SKIPS[0].name
QUICK = (SKIPS[1], SKIPS[2], SKIPS[6])


@cache
def _setting(room: bool) -> tuple[Radar, Any, MeshActor]:
    radar = Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    scene = load_scene("living_room" if room else None)
    scene.tune(radar.center_frequency)
    mesh = standing()
    person = MeshActor.from_mesh((mesh.vertices(0.0), mesh.faces), material="skin", position=(3, 0, 0),
                             orientation=(np.pi, 0, 0), velocity=(-0.5, 0, 0), name="person")  # fmt: skip
    return radar, scene, person


class _Run:
    """A run of frames, a static scene kept or not."""

    def __init__(self, skip: Skip) -> None:
        radar, scene, actor = _setting(skip.room)
        self._rtol = skip.allowed
        options = {"max_bounces": skip.max_bounces, "transmission": skip.transmission}
        self._make = lambda: tracer.Tracer(scene, radar, [actor], self._rtol, **options)
        self.radar, self._tracer = radar, self._make()
        self._moving = self._tracer.follow()

    def frame(self, index: int, anew: bool = False) -> tracer.Traced:
        if anew:
            self._tracer = self._make()
            self._moving = self._tracer.follow()
        wave = self.radar.waveform
        start = index * wave.frame_period
        return self._tracer.trace(start, start + wave.frame_length, self._moving)

    def answer(self, traced: tracer.Traced, index: int) -> tuple[ComplexArray, ComplexArray, float]:
        """Samples of the room with the adult's shadow and of the adult, and the level of the room without it."""
        start, eps = index * self.radar.waveform.frame_period, 0.1 * self._rtol
        still = synthesize(self.radar, traced.static, 0.0, eps=eps, device="cpu")
        level = float(np.linalg.norm(still))
        for shadow in traced.shadows:
            still = still + synthesize(self.radar, shadow.paths, start, eps=eps, device="cpu")
        parts = [synthesize(self.radar, each, start, eps=eps, device="cpu") for each in traced.actors]
        return still, np.sum(parts, axis=0), level


def _difference(found: ComplexArray, expected: ComplexArray, level: float | None = None) -> float:
    level = float(np.linalg.norm(expected)) if level is None else level
    return float(np.linalg.norm(found - expected)) / level if level else float(np.linalg.norm(found) > 0)


def _share(part: ComplexArray, level: float) -> float | None:
    return float(np.linalg.norm(part)) / level if level else None


def _row(name: str, on: float, off: float, differences: tuple[float, float], error_budget: float, **more: Any) -> Any:
    holds = max(differences) <= error_budget
    return {
        "skip": name, "seconds_on": on, "seconds_off": off, "times_faster": off / max(on, 1e-9),
        "difference_room": differences[0], "difference_actor": differences[1], "allowed": error_budget, "holds":
        holds,
    } | more  # fmt: skip


def row(skip: Skip, repeats: int = 2) -> dict[str, Any]:
    """Time of a warm frame with and without one skip, side by side, and the difference of their answers."""
    run = _Run(skip)
    run.frame(0)
    with skip.off():
        other = _Run(skip)
        if not skip.anew:
            other.frame(0)
    on, off = [], []
    for index in range(1, 1 + (1 if skip.anew else repeats)):
        elapsed, here = timed(lambda index=index: run.frame(index, skip.anew))
        on.append(elapsed)
        with skip.off():
            elapsed, there = timed(lambda index=index: other.frame(index, skip.anew or skip.name == ONCE))
        off.append(elapsed)
    ours, theirs = run.answer(here, index), other.answer(there, index)
    # The tolerance is of what the room returns, of which the adult hides the greater part.
    differences = _difference(ours[0], theirs[0], theirs[2]), _difference(ours[1], theirs[1])
    return _row(
        skip.name, min(on), min(off), differences,
        skip.allowed, of="adult in the living room" if skip.room else "adult in free space",
        difference_shadowed_room=_difference(ours[0], theirs[0]), room_left=_share(ours[0], ours[2]),
        rtol=skip.allowed, facets_on=here.report.facets, facets_off=there.report.facets, rays_on=here.report.rays,
        rays_off=there.report.rays,
    )  # fmt: skip


def corner() -> tuple[Radar, Any, MeshActor]:
    """A metal ball before a brick wall, over a floor of concrete."""
    radar = Radar.load("awr1843", "mmmesh", position=(-1.8, 0.3, 1.2), look_at=(0.0, 0.3, 1.0))
    scene = load_scene("floor_wall")
    scene.tune(radar.center_frequency)
    place, velocity = (-0.6, 0.3, 1.2), (-SPEED, 0, 0)
    return (
        radar,
        scene,
        MeshActor.from_mesh(ball(3, 0.15), material="pec", position=place, velocity=velocity, name="ball"),
    )


def bounces_row() -> dict[str, Any]:
    """Returns by way of walls that are below the tolerance are left out: a metal ball before a wall, over a floor."""
    radar, scene, thing = corner()

    def once() -> tuple[float, tracer.Traced]:
        made = tracer.Tracer(scene, radar, [thing], LOOSE, max_bounces=3)
        run = made.follow()
        made.trace(0.0, 0.0, run)
        return timed(lambda: made.trace(0.1, 0.1, run))

    once()  # kernels are compiled
    on, here = once()
    with _patched(*_ENERGY)():
        off, there = once()

    def samples(found: tracer.Traced) -> list[ComplexArray]:
        return [synthesize(radar, each, 0.1, eps=1e-4, device="cpu") for each in (found.static, found.moving)]

    first, second = (_difference(a, b) for a, b in zip(samples(here), samples(there), strict=True))
    return _row(
        "bounces below the tolerance", on, off, (first, second), LOOSE,
        of="a metal ball before a wall, over a floor, 3 bounces",
        paths_on=here.static.num_paths + here.moving.num_paths,
        paths_off=there.static.num_paths + there.moving.num_paths,
    )  # fmt: skip


def window_row() -> dict[str, Any]:
    """A street canyon and a window of two fifths of it: what is beyond is the IF filter's to remove, and range cells
    within differ by no more than the tolerance, which is of all that the canyon returns."""
    radar = Radar.load("awr1843", "mmmesh", position=(0.0, 0.0, 1.5), look_at=(10.0, 4.0, 1.5))
    scene = load_scene("simple_street_canyon")
    scene.tune(radar.center_frequency)
    count, limit, rtol = radar.waveform.num_samples, 0.4, default_rtol()
    narrow = replace(radar, waveform=replace(radar.waveform, range_limit=limit * radar.max_range))
    # Not the window's end, and not its beginning, where what lies at the end of the range axis leaks to.
    within = slice(int(0.05 * count), int(0.9 * limit * count))
    seconds, facets, found, level = [], [], [], 0.0
    for each in (narrow, radar):
        elapsed, made = timed(lambda each=each: tracer.Tracer(scene, each, [], rtol).static)
        samples = synthesize(radar, made.paths, 0.0, eps=0.1 * rtol, device="cpu")[0]
        profile = np.fft.fft(samples * np.blackman(count))
        seconds.append(elapsed)
        facets.append(len(made.facets))
        found.append(profile[..., within])
        level = float(np.linalg.norm(profile))
    return _row(
        "outside the range window", *seconds, (_difference(*found, level), 0.0), rtol,
        of="a street canyon, within the window", facets_on=facets[0], facets_off=facets[1],
    )  # fmt: skip


_PROCESS = """
import json, sys, time
begin = time.perf_counter()
{before}
import rfgen_sionna as rfgen
imported = time.perf_counter() - begin
import hashlib, numpy as np, trimesh
radar = rfgen.Radar.load("awr1843", "mmmesh")
ball = rfgen.Actor.from_mesh(trimesh.creation.icosphere(2, 0.1), material="pec", position=(2, 0, 0), velocity=(1, 0, 0))
samples = rfgen.Simulator(None, radar, [ball], rtol=1e-2).adc(radar.waveform.frame_period).data
print(json.dumps({{
    "import": imported, "all": time.perf_counter() - begin, "samples": hashlib.sha256(samples.tobytes()).hexdigest(),
    "loaded": [m for m in ("torch", "diffusers", "anny") if m in sys.modules],
}}))
"""
EAGER = "import importlib\nfor name in ({names}):\n    importlib.import_module(name)"
IMPORTS = ("torch", "mitsuba", "drjit", "sionna.rt", "diffusers", "anny")


def _process(before: str) -> dict[str, Any]:
    code = "import warnings; warnings.simplefilter('ignore')\n" + _PROCESS.format(before=before)
    text = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    found: dict[str, Any] = json.loads(text.splitlines()[-1])
    return found


def process_rows() -> list[dict[str, Any]]:
    """No import before its use, and no diffusion where no prompt asks for it: processes that simulate a ball, with the
    heavy libraries imported, or the image model read, beforehand."""
    names = ", ".join(repr(name) for name in IMPORTS)
    model = "from rfgen_sionna.generative.environment.environment_model import read_model\nread_model()"
    plain, eager, drawn = _process(""), _process(EAGER.format(names=names)), _process(model)
    return [
        _row(
            "no import before its use", plain["import"], eager["import"],
            (0.0, float(plain["samples"] != eager["samples"])), 0.0, of="import of the package; samples of a ball",
            loaded_on=plain["loaded"],
        ),
        _row(
            "no diffusion where no prompt asks for it", plain["all"], drawn["all"],
            (0.0, float(plain["samples"] != drawn["samples"])), 0.0, of="a ball, from start to samples",
            loaded_on=plain["loaded"],
        ),
    ]  # fmt: skip


def imports() -> dict[str, Any]:
    """What importing the package takes in a process of its own, and which heavy libraries it takes along."""
    code = (
        "import time, sys; b = time.perf_counter(); import rfgen_sionna; e = time.perf_counter() - b;"
        f"print(e, [m for m in {IMPORTS!r} if m in sys.modules])"
    )
    text = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split(" ", 1)
        for _ in range(3)
    ]
    return {"seconds": min(float(each[0]) for each in text), "imported": text[0][1].strip()}


def rows(quick: bool) -> dict[str, Callable[[], list[dict[str, Any]]]]:
    """What makes the rows, by name."""
    made: dict[str, Callable[[], list[dict[str, Any]]]] = {
        skip.name: lambda skip=skip: [row(skip, 1 if quick else 2)] for skip in (QUICK if quick else SKIPS)
    }
    if not quick:
        made["bounces"] = lambda: [bounces_row()]
    return made | {"range window": lambda: [window_row()], "imports and diffusion": process_rows}
