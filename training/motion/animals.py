"""Build the animal clips that ship with the package: `python -m training.motion.animals --pack FOLDER`.

Gaits become one closed cycle without forward motion. Toes that stand on the floor are held in place; the legs follow.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from scipy.interpolate import CubicSpline
from scipy.ndimage import label

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.things.animal_clips import FOLDER, AnimalClip, write_animal_clips
from training.commands import plainly

CYCLIC = ("walk", "run", "sneak", "trot", "gallop", "idle", "idle_alert", "eat", "sleep", "fly", "glide")
"""Actions that repeat."""
WHOLE = ("sit", "fetch")
"""Actions of which the whole clip is one cycle."""
NAMES = {"idle": "stand", "idle_alert": "crouch", "fetch": "sniff", "fall_down": "fall_over"}
"""Names of the pack that are others in the package."""
LEFT_OUT = ("turn_left", "turn_right")
"""Actions whose feet slide all over the floor."""
FRAME_RATE = 20.0
"""Of the pack [Hz]."""
TOES = {
    "dog": ("Front_Leg_Tip_L", "Front_Leg_Tip_R", "Back_Leg_Tip_L", "Back_Leg_Tip_R"),
    "horse": ("front_leg_leaf_l", "front_leg_leaf_r", "back_leg_leaf_l", "back_leg_leaf_r"),
    "bird": ("Toes_tip_L", "Toes_tip_R"),
}
"""Last joint of each leg."""
_LEG_LENGTH = 5
"""Joints of a leg that follow its toe, from the toe upwards."""
_SAMPLES_PER_FRAME = 2


def one_cycle(positions: FloatArray) -> tuple[FloatArray, float]:
    """A closed cycle (frame, joint, 3) of repeated motion (frame, joint, 3), and its length in frames.

    The length is the shortest one after which poses come again about as well as after any other.
    """
    count = len(positions)
    curve = CubicSpline(np.arange(count), positions)
    lengths = np.arange(8.0, 0.5 * count, 0.05)
    at = np.arange(0.0, 0.5 * count - 1.0)
    missed = np.array([np.abs(curve(at + length) - curve(at)).mean() for length in lengths])
    near = missed < 2.0 * missed.min() + 5e-4
    group = label(near)[0] == 1
    length = float(lengths[group][np.argmin(missed[group])])
    frames = _SAMPLES_PER_FRAME * round(length)
    phases = np.arange(frames) / frames * length
    cycles = int((count - 1) // length)
    mean = np.mean([curve(phases + k * length) for k in range(cycles)], axis=0)
    return mean, length


def planted(positions: FloatArray, names: list[str], parents: list[int], animal: str, speed: float) -> FloatArray:
    """Cycle (frame, joint, 3) with toes at rest while they stand, in the frame that moves by `speed` [m/frame]."""
    found = positions.copy()
    for name in TOES[animal]:
        toe = names.index(name)
        leg = [toe]
        while len(leg) < _LEG_LENGTH:
            leg.append(parents[leg[-1]])
        path = positions[:, toe] + np.arange(len(positions))[:, None] * np.array([speed, 0.0, 0.0])
        height = path[:, 2] - path[:, 2].min()
        low = height < 0.25 * np.ptp(height)
        if low.all() or not low.any():
            continue
        turn = int(np.argmin(low))  # a frame in the air comes first
        order = np.roll(np.arange(len(low)), -turn)
        unwrapped = path[order] + (order < turn)[:, None] * np.array([speed * len(low), 0.0, 0.0])
        stances, count = label(low[order])
        shift, known = np.zeros((len(low), 2)), np.zeros(len(low), bool)
        for k in range(1, count + 1):
            rows = np.flatnonzero(stances == k)
            shift[rows] = unwrapped[rows, :2].mean(axis=0) - unwrapped[rows, :2]
            known[rows] = True
        times = np.arange(len(low), dtype=float)
        spots, n = times[known], len(low)
        around = np.concatenate([spots - n, spots, spots + n])
        for axis in range(2):
            values = np.tile(shift[known, axis], 3)
            smooth = np.interp(times, around, values)
            moved = np.empty(n)
            moved[order] = smooth
            share = 1.0
            for step, joint in enumerate(leg):
                share = 1.0 if step < 2 else 1.0 - (step - 1) / (_LEG_LENGTH - 1)
                found[:, joint, axis] += share * moved
    return found


@plainly
def main(
    pack: Annotated[Path, typer.Option(help="Folder with animals.npz and animals.json.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder to write to.")] = FOLDER,
) -> None:
    """Write the animal clips of the package."""
    records = json.loads((pack / "animals.json").read_text())
    clips = []
    with np.load(pack / "animals.npz") as stored:
        for record in records:
            animal, action = record["animal"], record["action"]
            if action in LEFT_OUT:
                continue
            names = [str(name) for name in stored[f"joints_{animal}"]]
            parents = [int(parent) for parent in stored[f"parents_{animal}"]]
            positions = stored[record["name"]].astype(np.float64)[..., [2, 0, 1]]  # z up, facing +x
            speed, length = record["forward_speed"], float(len(positions) - 1)
            if action in WHOLE:
                positions = positions[:-1]
            elif action in CYCLIC:
                positions[..., 0] -= speed / FRAME_RATE * np.arange(len(positions))[:, None]
                positions, length = one_cycle(positions)
                if speed:
                    step = speed / FRAME_RATE * length / len(positions)
                    positions = planted(positions, names, parents, animal, step)
            clips.append(
                AnimalClip(
                    animal=animal,
                    action=NAMES.get(action, action),
                    joint_names=tuple(names),
                    positions=positions,
                    length=length / FRAME_RATE,
                    cyclic=action in (*CYCLIC, *WHOLE),
                    forward_speed=speed,
                )
            )
            Console().print(f"{record['name']}: {length / FRAME_RATE:.3f} s, {speed:g} m/s")
    out.mkdir(parents=True, exist_ok=True)
    write_animal_clips(out / "animals.npz", clips)
    Console().print(f"{out / 'animals.npz'}: {(out / 'animals.npz').stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    typer.run(main)
