"""Noise-free samples of simulated people doing RadHAR's activities, and of empty rooms.

    python -m experiments.radhar.synthesis --output FOLDER --recordings 12

Samples of a person are those of free space; a room's static samples are added later (`experiments.radhar.clouds`),
which leaves out the person's shadow on the room and the paths over both. Files that exist are kept, so a call continues
after an interruption; recordings come in turn over the activities, so that any number of them is balanced.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import rfgen_sionna as rfgen

PLACEMENTS = ((1.3, 0.0), (1.0, 12.0), (1.15, 6.0), (0.9, 14.0))
"""Height of the radar [m] and upward tilt [degrees], which RadHAR leaves open: four recordings an activity each."""
FRAME_RATE_HZ = 27.0
"""Frames a second that RadHAR's files hold; the board was set to 30."""
WINDOW_S = 2.4
"""Length of a recording [s]."""
ACTIVITIES = ("boxing", "jack", "jump", "squats", "walk")
"""Names of RadHAR's folders."""
PROMPTS: Mapping[str, tuple[str, ...]] = {
    "boxing": ("a person boxing, at {front} m, facing the radar",),
    "jack": ("a person does jumping jacks, {jacks} a minute, at {far} m, facing the radar",),
    "jump": (
        "a person hops in place with tiny hops, arms hanging, {hops} a minute, at {far} m, facing the radar",
        "a person hops in place with tiny hops, with hands on the hips, {hops} a minute, at {far} m, facing the radar",
    ),
    "squats": ("a person does shallow squats, {squats} a minute, at {front} m, facing the radar",),
    "walk": (
        "a person walks in a circle at {speed} m/s, at {middle} m",
        "a person walks in a loop at {speed} m/s, at {middle} m",
    ),
}
"""Prompts of each activity; the names in braces are ranges of `RANGES`."""
RANGES: Mapping[str, tuple[float, float]] = {
    "front": (1.5, 1.9),
    "middle": (1.4, 1.8),
    "far": (1.5, 2.3),
    "jacks": (55.0, 70.0),
    "squats": (28.0, 42.0),
    "speed": (0.35, 0.5),
    "hops": (110.0, 140.0),
}
"""Uniform ranges: distances [m], repetitions a minute, speed [m/s]. Distances, rates and the
walkers' speed are those of RadHAR's training part."""
MOTION_S = 10.0
"""Length of the motion that a recording is a part of [s]."""


@dataclass(frozen=True)
class Take:
    """One recording to simulate."""

    activity: str
    seed: int
    prompt: str
    start_s: float
    height_m: float = PLACEMENTS[0][0]
    tilt_deg: float = PLACEMENTS[0][1]

    @property
    def name(self) -> str:
        return f"{self.activity}-{self.seed:03d}"


def takes(recordings: int) -> Iterator[Take]:
    """The first `recordings` of each activity, in turn; the same seeds have the same prompts."""
    for number in range(recordings):
        for index, activity in enumerate(ACTIVITIES):
            rng = np.random.default_rng(np.random.SeedSequence([54, number, index]))
            values = {name: round(float(rng.uniform(*limits)), 2) for name, limits in RANGES.items()}
            start = float(rng.uniform(0.0, MOTION_S - WINDOW_S - 0.1))
            texts = PROMPTS[activity]
            place = PLACEMENTS[number // 4 % len(PLACEMENTS)]
            yield Take(activity, number, texts[number % len(texts)].format(**values), start, *place)


def radhar_radar(height_m: float = PLACEMENTS[0][0], tilt_deg: float = PLACEMENTS[0][1]) -> rfgen.Radar:
    """The IWR1443 in RadHAR's configuration, at the rate of the frames that were kept."""
    target = (3.0, 0.0, height_m + 3.0 * float(np.tan(np.radians(tilt_deg))))
    radar = rfgen.Radar.load("iwr1443boost", preset="radhar", position=(0, 0, height_m), look_at=target)
    return replace(radar, waveform=replace(radar.waveform, frame_period=1 / FRAME_RATE_HZ))


def simulate(take: Take, rtol: float) -> np.ndarray:
    """(frame, chirp, tx, rx, sample) noise-free samples [sqrt(W)]."""
    radar = radhar_radar(take.height_m, take.tilt_deg)
    person = rfgen.Actor.from_prompt(take.prompt, seed=take.seed, radar=radar, duration=MOTION_S)
    simulator = rfgen.Simulator(None, radar, [person], rtol=rtol)
    return simulator.adc(WINDOW_S, start=take.start_s, noise=False).data.astype(np.complex64)


def empty_rooms(count: int, folder: Path, rtol: float) -> None:
    """Write (chirp, tx, rx, sample) noise-free samples of `count` furnished rooms without people."""
    from rfgen_sionna.scene.furnished import furnished

    radar = radhar_radar()
    places = ("lab", "office", "living room", "classroom", "bedroom", "garage")
    for number in range(count):
        file = folder / f"room-{number:03d}.npy"
        if not file.exists():
            place = places[number % len(places)]
            scene = furnished(place, number, radar.center_frequency)
            cube = rfgen.Simulator(scene, radar, [], rtol=rtol).adc(1 / FRAME_RATE_HZ, noise=False)
            np.save(file, cube.data[0].astype(np.complex64))
            print(file.name, place, flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, required=True, help="folder for the samples")
    parser.add_argument("--recordings", type=int, default=12, help="recordings of each activity")
    parser.add_argument("--rooms", type=int, default=0, help="empty rooms instead of people")
    parser.add_argument("--part", type=int, nargs=2, default=(0, 1), metavar=("I", "N"), help="every N-th from I on")
    parser.add_argument("--rtol", type=float, default=0.1)
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    if arguments.rooms:
        empty_rooms(arguments.rooms, arguments.output, arguments.rtol)
        return
    part, parts = arguments.part
    for number, take in enumerate(takes(arguments.recordings)):
        file = arguments.output / f"{take.name}.npy"
        if number % parts == part and not file.exists():
            try:
                cube = simulate(take, arguments.rtol)
            except ValueError as error:  # a placement or motion that cannot be
                print(f"{take.name}: {take.prompt}: {error}", flush=True)
                continue
            np.save(file, cube)
            print(take.name, take.prompt, flush=True)


if __name__ == "__main__":
    main()
