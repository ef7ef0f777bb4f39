"""What each skip of the tracer saves, and that the answer stays within the tolerance without it.

A skip is turned off where it is made, by replacing the function or number that makes it. The answer is the ADC frame of
12 channels, in two parts that are compared each by itself: returns of the static scene with the actor's shadow, and
those of the actor.
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

from rfgen_sionna._types import ComplexArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor, load_scene
from rfgen_sionna.signal import synthesize
from rfgen_sionna.tracing import tracer
from rfgen_sionna.tracing.direct import run_scene
from rfgen_sionna.tracing.direct.run_scene import RunScene
from rfgen_sionna.tracing.direct.settings import Settings
from rfgen_sionna.tracing.gains import band
from rfgen_sionna.tracing.routes import image_tree, route_bounds
from rfgen_sionna.tracing.surface import tessellate
from tests.benchmarks.measuring import default_rtol, timed
from tests.benchmarks.scaling import corner
from tests.benchmarks.subjects import standing

Setting = tuple[Radar, Any, MeshActor]


def _adult(scene: str | None) -> Setting:
    radar = Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    around, mesh = load_scene(scene), standing()
    around.tune(radar.center_frequency)
    person = MeshActor.from_mesh((mesh.vertices(0.0), mesh.faces), material="skin", position=(3, 0, 0),
                                 orientation=(np.pi, 0, 0), velocity=(-0.5, 0, 0), name="person")  # fmt: skip
    return radar, around, person


ROOM, FREE, WALL = "adult in the living room", "adult in free space", "a metal ball before a wall, over a floor"
SETTINGS: dict[str, Callable[[], Setting]] = {
    ROOM: cache(lambda: _adult("living_room")), FREE: cache(lambda: _adult(None)), WALL: cache(corner),
}  # fmt: skip
Patch = tuple[Any, str, Any]


@dataclass(frozen=True)
class Skip:
    """One of them, with what shows it."""

    name: str
    without: tuple[Patch, ...]
    """Replacements that turn it off."""
    of: str = ROOM
    """Key of :data:`SETTINGS`."""
    anew: bool = False
    """Whether it acts on what is kept from one frame to the next: frames that begin with nothing kept are compared."""
    max_bounces: int = 1

    @contextmanager
    def off(self) -> Iterator[None]:
        with ExitStack() as stack:
            for owner, name, value in self.without:
                stack.enter_context(mock.patch.object(owner, name, value))
            yield


_COLLECT, _DEMAND, _SETTINGS = tracer.collect_surfaces, tessellate.required_splits, Settings.of


def _open_surfaces(*arguments: Any) -> Any:
    found = _COLLECT(*arguments)
    return replace(found, moving=tuple(replace(each, closed=False) for each in found.moving))


def _as_in_the_beam(
    corners: Any, viewpoint: Any, frequency: float, rtol: float, pattern_gain: Any, *more: Any
) -> tuple[Any, Any, Any]:
    """What is demanded of facets, as if the antennas sent as much everywhere, and as their gain asks for."""
    given = [_DEMAND(corners, viewpoint, frequency, rtol, gain, *more) for gain in (pattern_gain, _everywhere)]
    (coarse, parts, high), (coarse_too, *finer) = given
    return coarse | coarse_too, np.maximum(parts, finer[0]), np.maximum(high, finer[1])


def _everywhere(places: Any) -> Any:
    return np.ones(places.shape[:-1])


_FACING: Patch = (tracer, "collect_surfaces", _open_surfaces)
_BEAM: Patch = (tessellate, "required_splits", _as_in_the_beam)
_PAIRS: tuple[Patch, ...] = ((band, "MONOSTATIC", 0.0), (run_scene, "MONOSTATIC", 0.0))
_WEAK: Patch = (Settings, "of", staticmethod(lambda rtol: replace(_SETTINGS(rtol), omitted=0.0)))
_VIEW: Patch = (RunScene, "has_parallax", lambda self, poses: self.slabs is None)
_ROUTES: tuple[Patch, ...] = ((image_tree, "OMITTED_SHARE", 0.0), (route_bounds, "OMITTED_SHARE", 0.0))

SKIPS = (
    Skip("static parts are traced once", ()),
    Skip("facets that look away", (_FACING,)),
    Skip("coarse facets outside the antenna pattern", (_BEAM,), anew=True),
    Skip("one obliquity for a short baseline", _PAIRS),
    Skip("facets that return next to nothing", (_WEAK,), FREE),
    Skip("one view for the whole array", (_VIEW,), FREE),
    Skip("routes below the tolerance", _ROUTES, WALL, max_bounces=3),
    Skip("all of these", (_FACING, _BEAM, *_PAIRS, _WEAK, _VIEW), anew=True),
)
ONCE = SKIPS[0].name
QUICK = (SKIPS[1], SKIPS[4])


class _Run:
    """A run of frames, a static scene kept or not."""

    def __init__(self, skip: Skip) -> None:
        self.radar, scene, actor = SETTINGS[skip.of]()
        self._make = lambda: tracer.Tracer(scene, self.radar, [actor], default_rtol(), max_bounces=skip.max_bounces)
        self._begin()

    def _begin(self) -> None:
        self._tracer = self._make()
        self._moving = self._tracer.follow()

    def frame(self, index: int, anew: bool = False) -> tracer.Traced:
        if anew:
            self._begin()
        wave = self.radar.waveform
        start = index * wave.frame_period
        return self._tracer.trace(start, start + wave.frame_length, self._moving)

    def answer(self, traced: tracer.Traced, index: int) -> tuple[ComplexArray, ComplexArray, float]:
        """Samples of the static scene with the actor's shadow and of the actor, and the level of the static scene
        without it."""
        start, eps = index * self.radar.waveform.frame_period, 0.1 * default_rtol()
        still = synthesize(self.radar, traced.static, 0.0, eps=eps, device="cpu")
        level = float(np.linalg.norm(still))
        for shadow in traced.shadows:
            still = still + synthesize(self.radar, shadow.paths, start, eps=eps, device="cpu")
        parts = [synthesize(self.radar, each, start, eps=eps, device="cpu") for each in traced.actors]
        return still, np.sum(parts, axis=0), level


def _difference(found: ComplexArray, expected: ComplexArray, level: float | None = None) -> float:
    level = float(np.linalg.norm(expected)) if level is None else level
    return float(np.linalg.norm(found - expected)) / level if level else float(np.linalg.norm(found) > 0)


def _row(name: str, on: float, off: float, differences: tuple[float, float], error_budget: float, **more: Any) -> Any:
    return {
        "skip": name, "seconds_on": on, "seconds_off": off, "times_faster": off / max(on, 1e-9),
        "difference_room": differences[0], "difference_actor": differences[1], "allowed": error_budget,
        "holds": max(differences) <= error_budget,
    } | more  # fmt: skip


def row(skip: Skip, repeats: int = 2) -> dict[str, Any]:
    """Time of a warm frame with and without one skip, side by side, and the difference of their answers."""
    run = _Run(skip)
    run.frame(0)
    with skip.off():
        other = _Run(skip)
        other.frame(0)  # kernels of both are compiled
    on, off = [], []
    for index in range(1, 1 + (1 if skip.anew else repeats)):
        elapsed, here = timed(lambda index=index: run.frame(index, skip.anew))
        on.append(elapsed)
        with skip.off():
            elapsed, there = timed(lambda index=index: other.frame(index, skip.anew or skip.name == ONCE))
        off.append(elapsed)
    ours, theirs = run.answer(here, index), other.answer(there, index)
    # The tolerance is of what the static scene returns, of which the actor may hide the greater part.
    differences = _difference(ours[0], theirs[0], theirs[2]), _difference(ours[1], theirs[1])
    return _row(
        skip.name, min(on), min(off), differences, default_rtol(), of=skip.of,
        difference_shadowed_room=_difference(ours[0], theirs[0]), facets_on=here.report.facets,
        facets_off=there.report.facets,
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
    return made | {"range window": lambda: [window_row()], "imports and diffusion": process_rows}
