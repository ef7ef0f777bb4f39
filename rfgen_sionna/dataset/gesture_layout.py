"""DI-Gesture's layout: dynamic range-angle images, one file a sample.

Source: Y. Li et al., "Towards Domain-Independent and Real-Time Gesture Recognition Using mmWave Signal", IEEE TMC 2022,
and the description of its data in DI-HGR/cross_domain_gesture_dataset.
"""

from __future__ import annotations

from collections.abc import Hashable
from os import PathLike
from pathlib import Path

from rfgen_sionna.dataset.export_folder import Progress, file_name, new_folder, save_array, save_table, split_folder
from rfgen_sionna.dataset.representations import DRAI_BINS
from rfgen_sionna.dataset.windows import WindowReader

GESTURES = {
    "push": "Push", "pull": "Pull", "swipe_left": "SlideLeft", "swipe_right": "SlideRight",
    "circle_clockwise": "CircleClockwise", "circle_counterclockwise": "CircleCounterclockwise",
}  # fmt: skip
"""The six gestures of DI-Gesture among our actions -> their word in file names. The paper's spelling of the two circles
is not published."""


def to_di_gesture(
    folder: str | PathLike[str],
    output: str | PathLike[str],
    *,
    split: str | None = None,
    radar: str | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Write `train/y_SlideRight_e6_u21_p5_s4.npy`, …: (T, 32, 32) float32 power against range and angle.

    The first letter is y for the six gestures and n for any other action; e numbers the places (and their furniture),
    u the people, p the distances and azimuths, s the samples of the same kind. `labels.csv` says what each number
    stands for. Numbers begin with 1.

    Raises
    ------
    OutputError
        If the folder exists already, or cannot be written.
    ValueError
        If recordings have several actors, or somebody is beyond the 32 range bins.
    """
    reader = WindowReader(folder, split, "drai", ("action",), radar=radar, alike=False)
    rows = reader.recordings.rows
    environments = _numbers([(row.place, row.place_seed) for row in rows])
    users = _numbers([row.bodies for row in rows])
    positions = _numbers([(row.distance_m, row.azimuth_deg) for row in rows])
    samples: dict[Hashable, int] = {}
    with new_folder(output, overwrite) as target:
        table = []
        for number, window in enumerate(reader.windows, 1):
            run, row = reader.run(window.position), rows[window.position]
            limit = (DRAI_BINS - 0.5) * run.radar.range_resolution
            if row.distance_m is not None and row.distance_m > limit:
                raise ValueError(
                    f"recording {row.number} has its actor at {row.distance_m:.2f} m, beyond the {limit:.2f} m of "
                    f"{DRAI_BINS} range bins of radar '{run.radar.name}': choose nearer places, or a preset with "
                    "larger range cells"
                )
            action = row.actions[0]
            word = GESTURES.get(action) or file_name("".join(part.capitalize() for part in action.split("_")))
            place = tuple(
                numbers[key]
                for numbers, key in (
                    (environments, (row.place, row.place_seed)), (users, row.bodies),
                    (positions, (row.distance_m, row.azimuth_deg)),
                )
            )  # fmt: skip
            part = split_folder(row.split)
            kind = (part, word, place)
            samples[kind] = samples.get(kind, 0) + 1
            letter = "y" if action in GESTURES else "n"
            name = f"{letter}_{word}_e{place[0]}_u{place[1]}_p{place[2]}_s{samples[kind]}.npy"
            save_array(target / part / name, reader.arrays(window, run)[""])
            table.append({
                "file": f"{part}/{name}", "recording": row.number, "action": action, "place": row.place,
                "place_seed": row.place_seed, "body_seed": next(iter(row.bodies), None), "distance_m": row.distance_m,
                "azimuth_deg": row.azimuth_deg,
            })  # fmt: skip
            if progress is not None:
                progress(number, len(reader.windows))
        save_table(target / "labels.csv", table)
    return Path(output)


def _numbers(keys: list[Hashable]) -> dict[Hashable, int]:
    """Number, from 1, of each different key in the order of their first appearance."""
    return {key: number for number, key in enumerate(dict.fromkeys(keys), 1)}
