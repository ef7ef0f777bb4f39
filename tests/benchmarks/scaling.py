"""How times grow: facets, rays, paths, channels, chirps, frames, actors, bounces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from rfgen_sionna.radar import ElementPattern, Radar
from rfgen_sionna.scene import MeshActor, load_scene
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.tracer import Tracer
from tests.benchmarks import synthesis
from tests.benchmarks.measuring import best_of, exponent
from tests.benchmarks.subjects import SPEED, ball, sphere, standing


def facets(quick: bool) -> tuple[list[int], list[float]]:
    """An instant of the sphere."""
    levels = (3, 4, 5) if quick else (3, 4, 5, 6)
    seconds = []
    for level in levels:
        subject = sphere(77, level)
        tracer = Tracer(None, subject.radar, subject.actors)
        run, times = tracer.follow(), iter(np.arange(100) * 1e-3)
        seconds.append(best_of(lambda tracer=tracer, run=run, times=times: _instant(tracer, next(times), run)))
    return [20 * 4**level for level in levels], seconds


def _instant(tracer: Tracer, t: float, run: Any) -> None:
    tracer.trace(t, t, run)


def rays(quick: bool) -> tuple[list[int], list[float]]:
    """First hits on an adult."""
    mesh = standing()
    scene = RayScene([], [(mesh.vertices(0.0) + np.array([3.0, 0, -0.9]), mesh.faces)], origin=np.zeros(3))
    sizes, seconds = ([10**4, 10**5, 10**6] if quick else [10**4, 10**5, 10**6, 4 * 10**6]), []
    rng = np.random.default_rng(0)
    for size in sizes:
        directions = np.column_stack([np.ones(size), rng.uniform(-0.3, 0.3, (size, 2))])
        seconds.append(best_of(lambda directions=directions: scene.first_hit(np.zeros(3), directions)))
    return sizes, seconds


def paths(quick: bool) -> tuple[list[int], list[float]]:
    """Synthesis of a frame of 12 channels."""
    radar, all_paths = synthesis.frame("awr1843", "mmmesh", "people")
    sizes = [500, 2000, 8000] if quick else [500, 1000, 2000, 4000, 8000]
    return sizes, [_synthesis(radar, all_paths.select(np.arange(size))) for size in sizes]


def channels(quick: bool) -> tuple[list[int], list[float]]:
    """Synthesis of a cascade's frame for 1 … 12 of its Tx elements with 16 Rx, 2,000 paths."""
    radar, all_paths = synthesis.frame("mmwcas", "ti_default", "people")
    some = all_paths.select(np.arange(2000))
    sizes, seconds = [], []
    for count in (1, 3, 12) if quick else (1, 2, 3, 6, 12):
        fewer = replace(
            radar,
            waveform=replace(radar.waveform, tx_order=tuple(range(count))),
            tx_positions=radar.tx_positions[:count],
            tx_names=radar.tx_names[:count],
        )
        part = replace(some, a=some.a[:count], tau=some.tau[:count], tau_rate=some.tau_rate[:count])
        sizes.append(16 * count)
        seconds.append(_synthesis(fewer, part))
    return sizes, seconds


def chirps(quick: bool) -> tuple[list[int], list[float]]:
    """Synthesis of frames of more and more loops, 2,000 paths."""
    radar, all_paths = synthesis.frame("awr1843", "mmmesh", "people")
    some = all_paths.select(np.arange(2000))
    sizes = [32, 128, 512] if quick else [32, 64, 128, 256, 512, 1024]
    period = 1.0
    radars = [replace(radar, waveform=replace(radar.waveform, num_loops=n, frame_period=period)) for n in sizes]
    return sizes, [_synthesis(each, some) for each in radars]


def _synthesis(radar: Radar, some: Any) -> float:
    return best_of(lambda: synthesis.synthesize(radar, some, 0.0, eps=3e-4, device="cpu"), 2)


def frames(quick: bool) -> tuple[list[int], list[float]]:
    """A whole run of a ball of 5,120 facets in free space, 12 channels, noise included."""
    radar = Radar.load("awr1843", "mmmesh")
    actor = MeshActor.from_mesh(ball(4, 0.15), material="pec", position=(3, 0, 0), velocity=(SPEED, 0, 0), name="ball")
    simulator = Simulator(None, radar, [actor])
    sizes = [1, 2, 4] if quick else [1, 2, 4, 8, 16]

    def work(count: int) -> None:
        for _ in simulator.frames(count * radar.waveform.frame_period):
            pass

    return sizes, [best_of(lambda size=size: work(size), 1) for size in sizes]


def actors(quick: bool) -> tuple[list[int], list[float]]:
    """An instant of balls of 5,120 facets side by side."""
    radar = replace(Radar.load("awr1843", "mmmesh"), pattern=ElementPattern(0.0))
    sizes, seconds = [1, 2, 4] if quick else [1, 2, 4, 8, 16], []
    for size in sizes:
        balls = [
            MeshActor.from_mesh(
                ball(4, 0.15), material="pec", position=(3, 0.4 * i, 0), velocity=(SPEED, 0, 0), name=f"{i}"
            )
            for i in range(size)
        ]
        tracer = Tracer(None, radar, balls)
        run, times = tracer.follow(), iter(np.arange(100) * 1e-3)
        seconds.append(best_of(lambda tracer=tracer, run=run, times=times: _instant(tracer, next(times), run)))
    return sizes, seconds


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


def bounces(quick: bool) -> tuple[list[int], list[float]]:
    """An instant of a metal ball before a wall and over a floor, with these traced beforehand."""
    radar, scene, thing = corner()
    sizes, seconds = [1, 2, 3], []
    for size in sizes:
        tracer = Tracer(scene, radar, [thing], 1e-2, max_bounces=size)
        run, times = tracer.follow(), iter(np.arange(100) * 1e-3)
        seconds.append(
            best_of(lambda tracer=tracer, run=run, times=times: _instant(tracer, next(times), run), 1 if quick else 2)
        )
    return sizes, seconds


CURVES: dict[str, Callable[[bool], tuple[list[int], list[float]]]] = {
    "facets": facets, "rays": rays, "paths": paths, "channels": channels, "chirps": chirps, "frames": frames,
    "actors": actors, "bounces": bounces,
}  # fmt: skip


def run(name: str, quick: bool) -> dict[str, Any]:
    """One of the curves, with the exponent b of seconds = a size^b, fitted to its larger half."""
    curve = CURVES[name]
    sizes, seconds = curve(quick)
    return {
        "of": (curve.__doc__ or "").strip(), "sizes": sizes, "seconds": seconds,
        "exponent": exponent([float(size) for size in sizes], seconds),
    }  # fmt: skip
