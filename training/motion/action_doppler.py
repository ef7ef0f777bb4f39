"""Micro-Doppler of twenty actions, each beside that of the library's clip that it was made of:
`python -m training.motion.action_doppler`.

One body, one radar (AWR1843, one channel), free space; the person faces the radar at first, and the pelvis is 3 m away
in the mean, more where it would come nearer than 1.5 m.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from rfgen_sionna import Radar, Simulator
from rfgen_sionna.generative import Actor, MotionLibrary
from rfgen_sionna.generative.bodies.phenotype import person
from rfgen_sionna.generative.bodies.rig import Rig
from rfgen_sionna.generative.motion.clip_editing import placed
from rfgen_sionna.generative.performing import perform
from rfgen_sionna.processing import micro_doppler
from rfgen_sionna.processing.spectrogram import DopplerTime
from rfgen_sionna.records import Motion
from rfgen_sionna.show.stick_figures import body_joints
from rfgen_sionna.tolerance import DEFAULT_RTOL, RTOL_RANGE
from training.commands import plainly, progress_bar
from training.motion.action_table import PICTURE

SHOWN = (
    "walk", "run", "walk_backwards", "sidestep", "crawl", "jump", "jumping_jacks", "kick", "punch", "throw",
    "squat", "sit_down", "stand_up", "lie_down", "get_up", "fall", "pick_up", "cartwheel", "sneak", "dance",
)  # fmt: skip
_DISTANCE = 3.0
"""Of the person from the radar in the mean [m]."""
_NEAREST = 1.5
"""Least distance of the pelvis [m]."""
_MADE = 4.0
"""Length of the motions, of which the liveliest stretches are shown [s]."""
_RANGE_DB = 45.0
"""Of the colours."""
_FASTEST = 6.0
"""Radial speed at the edge of the pictures [m/s]."""


def doppler_radar() -> Radar:
    """One channel of an AWR1843 1 m over the floor, 10 frames of 28 ms a second."""
    radar = Radar.load("awr1843", preset="mmmesh", position=(0, 0, 1), look_at=(_DISTANCE, 0, 1))
    wave = replace(radar.waveform, tx_order=(0,), num_loops=384, num_samples=64)
    return replace(
        radar, waveform=wave, tx_positions=radar.tx_positions[:1], tx_names=radar.tx_names[:1],
        rx_positions=radar.rx_positions[:1], rx_names=radar.rx_names[:1],
    )  # fmt: skip


def seen(motion: Motion, body: Rig, radar: Radar, seconds: float, rtol: float) -> DopplerTime:
    """Spectrogram of a person with a motion, as long as it goes on."""
    way = motion.translation[:, :2] - motion.translation[0, :2]
    place = np.array([max(_DISTANCE + way[:, 0].mean(), _NEAREST + way[:, 0].max()), way[:, 1].mean()])
    actor = Actor.from_motion(motion, body=body, position=(place[0], place[1], 0.0), orientation=(np.pi, 0.0, 0.0))
    length = min(seconds, np.floor(motion.duration / radar.waveform.frame_period) * radar.waveform.frame_period)
    adc = Simulator(None, radar, [actor], rtol=rtol).adc(duration=length, noise=False)
    return micro_doppler(adc.data, radar, frame_times=adc.frame_times, static=True)


def lively(motion: Motion, seconds: float) -> Motion:
    """The stretch of a motion in which the joints move most, from the origin, facing +x."""
    size = min(round(seconds * motion.frame_rate) + 1, len(motion.translation))
    joints = body_joints(motion)
    moved = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(joints, axis=0), axis=-1).sum(axis=1))])
    start = int(np.argmax(moved[size - 1 :] - moved[: len(joints) - size + 1]))
    rows = slice(start, start + size)
    cut = replace(motion, rotations=motion.rotations[rows], translation=motion.translation[rows], contacts=None)
    return placed(cut, way=False)


def pair(action: str, seconds: float, seed: int) -> tuple[Motion, Motion, str]:
    """What `perform` makes of an action from clips, the clip that it begins with, and its name.

    Raises:
        ValueError: none of twenty seeds is made of clips.
    """
    for one in range(seed, seed + 20):
        made = perform(action, _MADE, one)
        if made.clips:
            clip = made.clips[0]
            return lively(made, seconds), lively(MotionLibrary().motion(clip), seconds), clip
    raise ValueError(f"action: {action!r} is made by rules in seeds {seed} to {seed + 19}; there is no clip beside it")


def draw(rows: dict[str, list[tuple[str, DopplerTime]]], path: Path, seconds: float) -> None:
    """Write a picture with two spectrograms for each action."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure((13.0, 1.55 * (-(-len(rows) // 2))), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(-(-len(rows) // 2), 4, sharex=True, sharey=True, squeeze=False)
    cells = grid.reshape(-1, 2)
    for axes, (action, both) in zip(cells, rows.items(), strict=False):
        for panel, (label, spectrum) in zip(axes, both, strict=True):
            level = 10.0 * np.log10(np.maximum(spectrum.power, 1e-30))
            top = float(level.max())
            panel.pcolormesh(
                spectrum.time, spectrum.velocity, level.T, vmin=top - _RANGE_DB, vmax=top, shading="nearest",
                rasterized=True,
            )  # fmt: skip
            panel.set_facecolor("#f0f0f0")
            panel.set_title(f"{action}: {label}", fontsize=7, pad=2)
            panel.set_ylim(-_FASTEST, _FASTEST)
            panel.set_xlim(0.0, seconds)
            panel.tick_params(labelsize=6)
    for panel in grid[-1]:
        panel.set_xlabel("time [s]", fontsize=7)
    for panel in grid[:, 0]:
        panel.set_ylabel("speed [m/s]", fontsize=7)
    figure.savefig(path, dpi=90)


@plainly
def main(
    out: Annotated[Path, typer.Option(help="Picture to write.")] = PICTURE,
    action: Annotated[list[str] | None, typer.Option(help="Actions instead of the twenty.")] = None,
    seconds: Annotated[float, typer.Option(min=0.1, help="Of each spectrogram [s].")] = 2.0,
    seed: Annotated[int, typer.Option(min=0, help="Of the motions.")] = 0,
    rtol: Annotated[float, typer.Option(help=f"Tolerance of the radar's samples, {RTOL_RANGE}.")] = DEFAULT_RTOL,
) -> None:
    """Draw the micro-Doppler of actions, made and captured."""
    radar = doppler_radar()
    pairs = {name: pair(name, seconds, seed) for name in action or SHOWN}
    body = person(None, seed=seed)
    rows: dict[str, list[tuple[str, DopplerTime]]] = {}
    with progress_bar() as bar:
        task = bar.add_task("actions", total=len(pairs), note="")
        for name, (made, clip, label) in pairs.items():
            rows[name] = [
                (f"seed {made.seed}", seen(made, body, radar, seconds, rtol)),
                (label, seen(clip, body, radar, seconds, rtol)),
            ]
            draw(rows, out, seconds)
            bar.update(task, advance=1, note=name)
    Console().print(f"{out}: {len(rows)} actions")


if __name__ == "__main__":
    typer.run(main)
