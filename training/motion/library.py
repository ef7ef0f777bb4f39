"""Build the motion library that ships with the package:
`python -m training.motion.library --mocap FOLDER --mocap FOLDER --out FOLDER`.

Clips under share-alike terms go into a file of their own.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from rfgen_sionna.generative.motion_library import FOLDER, LibraryClip, write_pack
from rfgen_sionna.records import Motion
from training.commands import plainly
from training.motion.mocap import MocapClip, read_pack

_OWN_FILES = {"CC-BY-SA-3.0": "hdm05"}
"""Terms -> name of the file that holds clips of these terms alone."""
_FILE = "captured"
"""Name of the file of all others."""


def library_files(clips: list[MocapClip]) -> dict[str, list[tuple[LibraryClip, Motion]]]:
    """Clips of each file, in the order of their names.

    Raises
    ------
    ValueError
        Two clips have one name.
    """
    repeated = [name for name, count in Counter(clip.name for clip in clips).items() if count > 1]
    if repeated:
        raise ValueError(f"two clips are called '{repeated[0]}': leave one of the packs out")
    files: dict[str, list[tuple[LibraryClip, Motion]]] = {}
    for clip in sorted(clips, key=lambda clip: clip.name):
        record = LibraryClip(
            name=clip.name,
            action=clip.action,
            captions=clip.captions,
            licence=clip.licence,
            source=clip.source,
            subject=clip.subject,
            kind=clip.kind,
            frames=len(clip.motion.translation),
            frame_rate=clip.motion.frame_rate,
        )
        files.setdefault(_OWN_FILES.get(clip.licence, _FILE), []).append((record, clip.motion))
    return files


@plainly
def main(
    mocap: Annotated[list[Path], typer.Option(help="Folder of a mocap pack; may be repeated.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder to write to.")] = FOLDER,
) -> None:
    """Write the clips of mocap packs as the library of the package."""
    clips = [clip for folder in mocap for clip in read_pack(folder)]
    out.mkdir(parents=True, exist_ok=True)
    for name, entries in library_files(clips).items():
        path = out / f"{name}.npz"
        write_pack(path, entries)
        minutes = sum(record.duration for record, _ in entries) / 60
        Console().print(f"{path}: {len(entries)} clips, {minutes:.1f} minutes, {path.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    typer.run(main)
