"""Simulate falls and write those that are believable as a file of the motion library:
`python -m training.motion.falls --out rfgen_sionna/generative/library/simulated.npz --seed 0`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from rfgen_sionna.generative.motion_library import FOLDER, LibraryClip, MotionLibrary, write_pack
from rfgen_sionna.records import Motion
from training.commands import plainly, progress_bar
from training.motion.falls.believable import catches_itself, doubts
from training.motion.falls.captions import captions
from training.motion.falls.scenarios import KINDS, draw
from training.motion.falls.simulation import Fall, FallingBody
from training.motion.falls.starts import Start, all_starts
from training.motion.falls.stumbles import Stumble, stumbled

COUNTS = {
    "trip": 24, "forward": 24, "backward": 44, "left": 40, "right": 40, "slip": 42, "faint": 44, "from_chair": 42,
    "sink": 40,
}  # fmt: skip
"""Clips of each kind that is simulated."""
STUMBLES = 40
"""Clips of walks with a stumble."""
_TRIES = 8
"""Most simulations for each clip that is wanted."""


def simulate(
    kind: str, count: int, starts: dict[str, list[Start]], seed: int, rejected: Counter[str] | None = None
) -> Iterator[Fall]:
    """Believable falls of a kind, in the order of their draws.

    Args:
        kind: one of `KINDS`.
        count: falls that are wanted.
        starts: moments to begin from, by place.
        seed: of all draws.
        rejected: counts the kinds of the falls that were not believable.

    Raises:
        ValueError: of eight times as many simulations too few are believable.
    """
    found = 0
    for attempt in range(_TRIES * count):
        if found == count:
            return
        random = np.random.default_rng([seed, list(KINDS).index(kind), attempt])
        fall = FallingBody(draw(kind, starts, random)).run()
        if doubts(fall):
            if rejected is not None:
                rejected[kind] += 1
            continue
        found += 1
        yield fall
    if found < count:
        raise ValueError(f"{kind}: {found} of {_TRIES * count} simulated falls are believable; {count} are wanted")


def stumbles(count: int, starts: Sequence[Start], seed: int) -> list[tuple[LibraryClip, Motion]]:
    """Records and motions of walks with a stumble, in the order of their draws."""
    random = np.random.default_rng([seed, len(KINDS)])
    found: list[tuple[LibraryClip, Motion]] = []
    for _ in range(_TRIES * count):
        start = starts[int(random.integers(len(starts)))]
        motion = stumbled(start, Stumble.drawn(random))
        if motion is None or not catches_itself(motion):
            continue
        record = _record(f"sim_stumble_{len(found):03d}", start.clip, "stumble", motion)
        found.append((replace(record, subject=f"{start.clip.subject}, with a stumble", kind="edited"), motion))
        if len(found) == count:
            break
    return found


def _record(name: str, source: LibraryClip, kind: str, motion: Motion) -> LibraryClip:
    return LibraryClip(
        name=name,
        action=motion.action,
        captions=captions(kind),
        licence=source.licence,
        source=f"begins with {source.name}",
        subject=source.subject,
        kind="simulated",
        frames=len(motion.translation),
        frame_rate=motion.frame_rate,
    )


def entry(fall: Fall, number: int) -> tuple[LibraryClip, Motion]:
    """Record and motion of a fall, the `number`-th of its kind, under the terms of the clip that it begins with."""
    case = fall.scenario
    record = _record(f"sim_{case.kind}_{number:03d}", case.start.clip, case.kind, fall.motion)
    return replace(record, subject=f"simulated adult {1.70 * case.size:.2f} m {case.mass:.0f} kg"), fall.motion


@plainly
def main(
    out: Annotated[Path, typer.Option(help="File to write.")] = FOLDER / "simulated.npz",
    seed: Annotated[int, typer.Option(help="Seed of all draws.")] = 0,
    share: Annotated[float, typer.Option(help="Share of the clips of each kind to make.", min=0.01, max=1.0)] = 1.0,
) -> None:
    """Write simulated falls, slips, faints and heavy sitting down, and walks with a stumble."""
    starts = all_starts(MotionLibrary())
    walks = stumbles(max(1, round(share * STUMBLES)), starts["swing"], seed)
    counts = {kind: max(1, round(share * count)) for kind, count in COUNTS.items()}
    clips, rejected = list[tuple[LibraryClip, Motion]](), Counter[str]()
    with progress_bar() as progress:
        bar = progress.add_task("falls", total=sum(counts.values()), note="")
        for kind, count in counts.items():
            for number, fall in enumerate(simulate(kind, count, starts, seed, rejected)):
                clips.append(entry(fall, number))
                progress.update(bar, advance=1, note=f"{kind}: {rejected[kind]} were not believable")
    clips += walks
    out.parent.mkdir(parents=True, exist_ok=True)
    write_pack(out, clips)
    seconds = sum(record.duration for record, _ in clips)
    Console().print(f"{out}: {len(clips)} clips, {seconds / 60:.1f} minutes, {out.stat().st_size / 1e6:.2f} MB")
    for kind, count in counts.items():
        Console().print(f"  {kind}: {count} clips of {count + rejected[kind]} simulations")
    Console().print(f"  stumble: {len(walks)} clips")


if __name__ == "__main__":
    typer.run(main)
