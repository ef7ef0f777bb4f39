"""Whether two checkouts simulate the same bits: samples, paths and PIRs of twelve scenes.

    python tests/benchmarks/same_bits.py OLD                   OLD against this checkout
    python tests/benchmarks/same_bits.py OLD NEW               OLD against another one
    python tests/benchmarks/same_bits.py OLD --store FOLDER    run OLD alone and keep its results
    python tests/benchmarks/same_bits.py FOLDER                kept results against this checkout
    python tests/benchmarks/same_bits.py FOLDER --scenes walk corner

Each scene asserts that it holds the effect that it is named for. Each checkout runs in a process of its own: same
interpreter, same packages, one thread, no CUDA device. The table has a row per scene, with processor time [s]. Arrays
are the same if their type, shape and bytes are; those that differ are listed below the table with the largest
difference relative to the largest value. The exit status is 1 where anything differs or a scene fails. Bits also depend
on the processor and the versions of packages: kept results are of one machine.
"""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

import rfgen_sionna as rfgen

Arrays = dict[str, NDArray[Any]]
"""Arrays of a scene by name; the part before the slash is the kind."""
KINDS = ("adc", "paths", "pir")
ROOT = Path(__file__).resolve().parents[2]
RESULTS = "results.json"
RTOL = 0.03
PANE = """<scene version="2.1.0">
<bsdf type="itu-radio-material" id="glass">
<string name="type" value="glass"/><float name="thickness" value="0.006"/></bsdf>
<shape type="ply" id="mesh-pane"><string name="filename" value="{}"/><ref id="glass" name="bsdf"/>
<transform name="to_world"><rotate y="1" angle="90"/><translate x="1" z="1"/></transform></shape></scene>
"""
TOWARDS_X = {"position": (0, 0, 1), "look_at": (3, 0, 1)}
BEFORE_WALL = {"position": (-1.8, 0.3, 1.2), "look_at": (0.0, 0.3, 1.0)}
SHORT = {"preset.mmmesh.num_loops": 32, "preset.mmmesh.num_samples": 128}
ENVIRONMENT = {
    "CUDA_VISIBLE_DEVICES": "",
    "PYTHONHASHSEED": "0",
    **{f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMEXPR", "VECLIB_MAXIMUM")},
}
"""Variables that pin what bits depend on: the order of sums goes by the number of threads."""


def walk() -> Arrays:
    """Two frames of a walking adult in free space."""
    radar = awr1843(**TOWARDS_X)
    found = traced(None, radar, [person("a person walking back and forth, at 3 m", radar)], t=0.5, frames=2)
    assert np.ptp(found["paths/tau_rate"]) > 1e-9
    return found


def jacks() -> Arrays:
    """An adult doing jumping jacks, with the bounces between the limbs and the trunk."""
    radar = awr1843(**TOWARDS_X)
    return traced(None, radar, [person("a person doing jumping jacks, at 3 m", radar)], t=0.4, max_bounces=2)


def living_room() -> Arrays:
    """An adult in the modelled living room."""
    radar, scene = awr1843(**TOWARDS_X), rfgen.load_scene("living_room")
    found = traced(scene, radar, [person("a person doing jumping jacks, at 3 m", radar)])
    assert len(np.unique(found["paths/object_id"])) > 10
    return found


def ghosts() -> Arrays:
    """Two metal balls before a wall and over a floor: ghosts, and what one ball shows of the other."""
    balls = [ball("ball", (-0.6, 0.3, 1.2), velocity=(-1, 0, 0)), ball("other", (-0.7, 0.7, 1.2))]
    found = traced(rfgen.load_scene("floor_wall"), awr1843(**BEFORE_WALL), balls, max_bounces=3)
    assert {1, 2, 3} <= of(found, "ball", "bounces") | of(found, "other", "bounces")
    return found


def corner() -> Arrays:
    """A moving trihedral before the corner of a floor and a wall."""
    e = 0.1 * np.eye(3)
    turn = np.array([[-1, -1, -1], [1, -1, 0], [1, 1, -2]]) / np.sqrt([[3], [2], [6]])
    vertices = np.array([np.zeros(3), *e, e[0] + e[1], e[1] + e[2], e[2] + e[0]]) @ turn.T
    faces = [[0, 1, 4], [0, 4, 2], [0, 2, 5], [0, 5, 3], [0, 3, 6], [0, 6, 1]]
    mesh = vertices * [1, 1, np.linalg.det(turn)], faces
    pose = {"position": (-0.5, 0.8, 0.3), "velocity": (-1, 0, 0)}
    actor = rfgen.Actor.from_mesh(mesh, material="pec", name="trihedral", **pose)
    radar = awr1843(position=(-1.5, 0.3, 0.5), look_at=(0.0, 0.3, 0.2))
    found = traced(rfgen.load_scene("floor_wall"), radar, [actor], max_bounces=3)
    assert 3 in of(found, "trihedral", "bounces")
    assert 2 in of(found, "wall", "bounces")
    return found


def slab() -> Arrays:
    """Balls that move behind a pane of glass of the scene and behind a cloth."""
    import sionna.rt

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "pane.xml"
        file.write_text(PANE.format(Path(sionna.rt.__file__).parent / "scenes/simple_reflector/meshes/reflector.ply"))
        scene = rfgen.load_scene(file)
        assert scene.objects[0].properties.thickness > 0
    cloth = dataclasses.replace(rfgen.material("clothing"), thickness=1e-3)
    square = [[1, 0.6, 0.8], [1, 1.0, 0.8], [1, 1.0, 1.2], [1, 0.6, 1.2]], [[0, 1, 2], [0, 2, 3]]
    sheet = rfgen.Actor.from_mesh(square, material=cloth, name="cloth", velocity=(0, 0.5, 0))
    balls = [ball("behind glass", (2, 0, 1), velocity=(-1, 0, 0)), ball("behind cloth", (1.5, 1.2, 1))]
    found = traced(scene, awr1843(**TOWARDS_X), [*balls, sheet], transmission=True)
    assert all(of(found, name, "bounces") for name in ("pane", "behind glass", "behind cloth", "cloth"))
    return found


def cascade() -> Arrays:
    """Two balls, one partly behind the other, seen by 12 x 16 elements."""
    radar = rfgen.Radar.load("mmwcas", overrides={"preset.ti_default.num_loops": 4}, **TOWARDS_X)
    balls = [ball("near", (2.0, 0.1, 1.0), velocity=(1, 0, 0)), ball("far", (3.0, 0.25, 1.0), velocity=(0, -1, 0))]
    found = traced(None, radar, balls)
    assert found["paths/a"].shape[:2] == (12, 16)
    return found


def moving_radar() -> Arrays:
    """A radar that travels and turns over a metal plate, and the ghost of a ball in it."""

    def trajectory(t: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        return (-1.5 + 0.8 * t, 0.1 * np.sin(3 * t), 0.6), (0.2 * t, 0.3, 0.0)

    actors = [ball("ball", (0.2, 0.0, 0.3))]
    found = traced(rfgen.load_scene("simple_reflector"), awr1843(trajectory=trajectory), actors, t=0.1, max_bounces=2)
    assert {1, 2} <= of(found, "ball", "bounces")
    assert of(found, "reflector", "bounces")
    return found


def hand() -> Arrays:
    """A push whose hand comes to 0.3 m."""
    loops = {"preset.di_gesture.num_loops": 16}
    radar = rfgen.Radar.load("awr1843", "di_gesture", position=(0, 0, 1.2), look_at=(1, 0, 1.2), overrides=loops)
    actor = person("a person pushing with the right hand, at 0.9 m", radar)
    times = np.linspace(0, 3, 61)
    away = np.array([np.linalg.norm(actor.vertices(t) - radar.position, axis=1).min() for t in times])
    t = float(times[np.argmin(np.abs(away - 0.3))])
    found = traced(None, radar, [actor], t=t)
    nearest = 0.5 * 299_792_458.0 * found["paths/tau"].min()
    assert 0.25 < nearest < 0.35, f"the hand is at {nearest:.2f} m, its nearest {away.min():.2f} m"
    return found


def car() -> Arrays:
    """A car on a path behind a rough plate."""
    import sionna.rt

    from rfgen_sionna.generative.driving import Drive

    mesh: Any = trimesh.load(Path(sionna.rt.__file__).parent / "scenes/low_poly_car.ply", force="mesh", process=False)
    mesh.invert()
    way = Drive(np.array([(7, -3, 0), (5.5, 0, 0), (4.5, 3, 0)], dtype=float), 3.0)
    actor = rfgen.Actor.from_mesh(mesh, material="metal", name="car", trajectory=way)
    rough = dataclasses.replace(rfgen.material("concrete"), scattering_coefficient=0.3)
    square = [[3, -0.2, 0.3], [3.3, -0.2, 0.4], [3.3, 0.2, 0.4], [3, 0.2, 0.3]], [[0, 1, 2], [0, 2, 3]]
    plate = rfgen.Actor.from_mesh(square, material=rough, name="plate")
    found = traced(None, awr1843(**TOWARDS_X), [actor, plate], t=1.0)
    assert of(found, "car", "bounces")
    assert of(found, "plate", "bounces")
    return found


def position2go() -> Arrays:
    """Infineon's radar at 24 GHz with its noise."""
    radar = rfgen.Radar.load("position2go", **TOWARDS_X)
    balls = [ball("ball", (4, 0.5, 1), velocity=(-2, 0, 0)), ball("other", (6, -1, 1), velocity=(3, 0, 0))]
    found = traced(None, radar, balls, frames=5)
    simulator = rfgen.Simulator(None, radar, balls, rtol=RTOL)
    found["adc/noisy"] = simulator.adc(5 * radar.waveform.frame_period, seed=3).data
    assert found["adc/samples"].shape[2:4] == (1, 2)
    return found


def imagined() -> Arrays:
    """A living room in words through the diffusion model, with the learned motion of somebody in it."""
    radar = awr1843(**TOWARDS_X)
    with tempfile.TemporaryDirectory() as folder, rfgen.generate(
        "a person pushing, 2 m away", environment="a living room", radar=radar, duration=radar.waveform.frame_period,
        seed=1, output=Path(folder) / "run.h5", noise=False, rtol=RTOL,
    ) as run:  # fmt: skip
        assert "diffusion" in run.report, run.report
        room, samples = run.pir(0), run.cube().data
    found = traced(None, radar, [ball("ball", (1.0, 0.0, 1.0))], environment=room)
    assert int(rfgen.PathKind.ENVIRONMENT) in found["paths/kind"]
    return found | {"adc/generated": samples} | fields("pir/generated ", room)


ALL = (walk, jacks, living_room, ghosts, corner, slab, cascade, moving_radar, hand, car, position2go, imagined)
SCENES: dict[str, Callable[[], Arrays]] = {scene.__name__: scene for scene in ALL}


def awr1843(**pose: Any) -> Any:
    return rfgen.Radar.load("awr1843", preset="mmmesh", overrides=SHORT, **pose)


def ball(name: str, position: tuple[float, float, float], **options: Any) -> Any:
    sphere = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    return rfgen.Actor.from_mesh(sphere, material="pec", name=name, position=position, **options)


def person(prompt: str, radar: Any) -> Any:
    return rfgen.Actor.from_prompt(prompt, seed=0, radar=radar)


def traced(scene: Any, radar: Any, actors: list[Any], t: float = 0.0, frames: int = 1, **options: Any) -> Arrays:
    """Noise-free samples of `frames` frames from `t` [s] on, and the paths and the PIR at `t`."""
    simulator = rfgen.Simulator(scene, radar, actors, rtol=RTOL, **options)
    samples = simulator.adc(frames * radar.waveform.frame_period, start=t, noise=False).data
    found = {"adc/samples": samples} | fields("paths/", simulator.paths(t))
    found |= fields("pir/", simulator.pir(t, resolution=(48, 64)))
    for name in ("adc/samples", "paths/a", "pir/energy"):
        assert np.abs(found[name]).max() > 0.0, f"{name} is empty"
    return found


def fields(prefix: str, record: Any) -> Arrays:
    """Every field of a dataclass as an array; those that are None are left out."""
    values = ((field.name, getattr(record, field.name)) for field in dataclasses.fields(record))
    return {f"{prefix}{name}": np.asarray(value) for name, value in values if value is not None}


def of(found: Arrays, name: str, field: str) -> set[int]:
    """Values of a field among the paths of an object."""
    number = list(found["paths/object_names"]).index(name)
    return set(found[f"paths/{field}"][found["paths/object_id"] == number].tolist())


def run_scenes(checkout: Path, names: list[str], folder: Path) -> None:
    """The child process: arrays of each scene into `folder`, and a summary of them all."""
    import drjit
    import torch

    drjit.set_thread_count(1)
    torch.set_num_threads(1)
    home = Path(rfgen.__file__).resolve()
    assert home.is_relative_to(checkout), f"{home} is not in {checkout}"
    results: dict[str, Any] = {}
    for name in names:
        begin = time.process_time()
        try:
            arrays = SCENES[name]()
        except Exception:
            results[name] = {"error": traceback.format_exc()}
        else:
            seconds = time.process_time() - begin
            np.savez(folder / f"{name}.npz", **arrays)
            results[name] = {"seconds": seconds, "arrays": {key: digest(each) for key, each in arrays.items()}}
        print(f"{name}: {results[name].get('seconds', np.nan):.1f} s", file=sys.stderr, flush=True)
        (folder / RESULTS).write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")


def digest(values: NDArray[Any]) -> str:
    """Digest of type, shape and bytes."""
    head = f"{values.dtype.str} {values.shape} ".encode()
    return hashlib.sha256(head + np.ascontiguousarray(values).tobytes()).hexdigest()


def results_of(source: Path, names: list[str], folder: Path) -> tuple[dict[str, Any], Path]:
    """Summaries of scenes and the folder of their arrays: kept ones, or those of a checkout that runs now."""
    kept = source / RESULTS
    if not kept.is_file():
        if not (source / "rfgen_sionna").is_dir():
            raise SystemExit(f"{source} is neither a checkout nor a folder of kept results")
        folder.mkdir(parents=True, exist_ok=True)
        # -P: modules beside this file must not hide others of their names.
        command = [sys.executable, "-P", "-W", "ignore", str(Path(__file__).resolve()), str(source), "--scenes", *names]
        environment = os.environ | ENVIRONMENT | {"PYTHONPATH": str(source)}
        print(source, file=sys.stderr)
        subprocess.run([*command, "--child", str(folder)], cwd=folder, env=environment, check=True)
        kept, source = folder / RESULTS, folder
    return json.loads(kept.read_text(encoding="utf-8")), source


def difference(name: str, key: str, old: Path, new: Path) -> str:
    """How an array that is not the same differs."""
    with np.load(old / f"{name}.npz") as before, np.load(new / f"{name}.npz") as after:
        if key not in before or key not in after:
            return "new" if key in after else "missing"
        first, second = before[key], after[key]
    if (first.dtype, first.shape) != (second.dtype, second.shape):
        return f"{first.dtype} {first.shape} became {second.dtype} {second.shape}"
    if first.dtype.kind not in "biufc":
        return "other texts"
    first, second = first.astype(np.complex128), second.astype(np.complex128)
    apart, largest = (np.nan_to_num(np.abs(each)).max() for each in (second - first, first))
    return f"{apart / (largest or 1.0):.1e} of the largest value"


def compared(names: list[str], old: tuple[dict[str, Any], Path], new: tuple[dict[str, Any], Path]) -> bool:
    """Print the table; whether everything is the same."""
    print(f"{'scene':<14}" + "".join(f"{kind:>8}" for kind in KINDS) + f"{'old [s]':>9}{'new [s]':>9}")
    notes = []
    for name in names:
        before, after = old[0].get(name, {"error": "not among the kept results"}), new[0][name]
        failed = [f"{who}: {each['error']}" for who, each in (("old", before), ("new", after)) if "error" in each]
        if failed:
            print(f"{name:<14}  failed")
            notes += [f"{name}, {each}" for each in failed]
            continue
        first, second = before["arrays"], after["arrays"]
        differ = [key for key in sorted({*first, *second}) if first.get(key) != second.get(key)]
        notes += [f"{name}, {key}: {difference(name, key, old[1], new[1])}" for key in differ]
        words = ("DIFFERS" if any(key.startswith(f"{kind}/") for key in differ) else "same" for kind in KINDS)
        row = "".join(f"{word:>8}" for word in words)
        print(f"{name:<14}{row}{before['seconds']:>9.1f}{after['seconds']:>9.1f}")
    print("\n".join(["", *notes]) if notes else "all the same")
    return not notes


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", type=Path, help="checkout, or folder of kept results")
    parser.add_argument("new", type=Path, nargs="?", help="checkout; this one if left out")
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES), help="these alone")
    parser.add_argument("--store", type=Path, help="new folder to keep the results of OLD in")
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child is not None:
        run_scenes(options.old.resolve(), options.scenes, options.child)
        return 0
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "old" if options.store is None else options.store
        old = results_of(options.old.resolve(), options.scenes, store.resolve())
        if options.store is not None and options.new is None:
            return int(any("error" in each for each in old[0].values()))
        new = results_of((options.new or ROOT).resolve(), options.scenes, Path(folder) / "new")
        return int(not compared(options.scenes, old, new))


if __name__ == "__main__":
    sys.exit(main())
