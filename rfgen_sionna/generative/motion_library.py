"""Motion that ships with the package, captured or simulated: captioned clips on one skeleton, with the terms of each.

`library/<name>.npz` holds clips of one kind of terms; `library/README.md` is their card. Rotation vectors are stored
in steps of pi / 2^15, positions in quarters of a millimetre, both as second differences.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, NUM_BODY_JOINTS, PARENTS
from rfgen_sionna.records import Motion

FOLDER = Path(__file__).with_name("library")
"""Folder of the shipped files."""
_ANGLE = np.pi / (1 << 15)
"""Step of the components of rotation vectors [rad]."""
_LENGTH = 0.25e-3
"""Step of positions [m]."""


@dataclass(frozen=True, repr=False)
class LibraryClip(ShortRepr):
    """One clip of the library, without its poses."""

    name: str
    action: str
    captions: tuple[str, ...]
    licence: str
    """Terms of the clip, as named in the card."""
    source: str
    subject: str
    kind: str
    """"mocap", "keyframed" by hand, "simulated" by physics, or "edited", a captured clip changed by rules."""
    frames: int
    frame_rate: float
    """[Hz]"""

    @property
    def duration(self) -> float:
        """[s]"""
        return (self.frames - 1) / self.frame_rate


class MotionLibrary:
    """Clips of the files of a folder, in the order of their names.

    Parameters
    ----------
    folder
        Folder of the files; the shipped one by default.

    Raises
    ------
    FileNotFoundError
        The folder has no library file.
    """

    def __init__(self, folder: Path = FOLDER) -> None:
        files = sorted(Path(folder).glob("*.npz"))
        if not files:
            raise FileNotFoundError(f"'{folder}' has no library of motions (*.npz)")
        self._packs = [_Pack(path) for path in files]
        self.clips = tuple(sorted((clip for pack in self._packs for clip in pack.clips), key=lambda clip: clip.name))

    def __len__(self) -> int:
        return len(self.clips)

    def __iter__(self) -> Iterator[LibraryClip]:
        return iter(self.clips)

    def __repr__(self) -> str:
        minutes = sum(clip.duration for clip in self.clips) / 60
        return f"MotionLibrary({len(self.clips)} clips, {minutes:.0f} minutes, {len(self.actions)} actions)"

    @cached_property
    def actions(self) -> dict[str, tuple[LibraryClip, ...]]:
        """Clips of each action, by its name."""
        found: dict[str, list[LibraryClip]] = {}
        for clip in self.clips:
            found.setdefault(clip.action, []).append(clip)
        return {action: tuple(found[action]) for action in sorted(found)}

    def search(self, words: str) -> tuple[LibraryClip, ...]:
        """Clips whose name, action or captions contain each of the `words`; all for an empty text."""
        wanted = words.lower().split()
        return tuple(
            clip
            for clip in self.clips
            if all(word in " ".join((clip.name, clip.action, *clip.captions)).lower() for word in wanted)
        )

    def motion(self, name: str) -> Motion:
        """Poses of the clip called `name`, on the mean adult's skeleton, at 20 Hz, on the floor z = 0.

        Raises
        ------
        KeyError
            There is no such clip.
        """
        for pack in self._packs:
            if name in pack.rows:
                return pack.motion(name)
        near = [clip.name for clip in self.search(name.replace("_", " "))][:5]
        raise KeyError(f"no clip '{name}' in the library" + (f"; near it: {', '.join(near)}" if near else ""))


class _Pack:
    """One file of the library; poses are decoded on first use."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with np.load(path, allow_pickle=False) as stored:
            records = json.loads(stored["clips"].tobytes())
            self._offsets, self._rate = stored["offsets"], float(stored["frame_rate"])
        self.clips = [_clip(record) for record in records]
        ends = np.cumsum([clip.frames for clip in self.clips])
        self.rows = {clip.name: slice(end - clip.frames, end) for clip, end in zip(self.clips, ends, strict=True)}

    @cached_property
    def _poses(self) -> tuple[NDArray[np.int16], NDArray[np.int32], NDArray[np.bool_]]:
        with np.load(self._path, allow_pickle=False) as stored:
            contacts = np.unpackbits(stored["contacts"], axis=0, count=len(stored["rotations"])).astype(bool)
            return stored["rotations"], stored["translations"], contacts

    def motion(self, name: str) -> Motion:
        rotations, translations, contacts = self._poses
        rows = self.rows[name]
        vectors = _integrated(rotations[rows]).astype(np.float64) * _ANGLE
        joints = self._offsets.shape[0]
        quaternions = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_quat().reshape(-1, joints, 4)
        return Motion(
            rotations=_continuous(quaternions),
            translation=_integrated(translations[rows]).astype(np.float64) * _LENGTH,
            frame_rate=self._rate,
            joint_names=JOINT_NAMES[:joints],
            parents=PARENTS[:joints],
            offsets=self._offsets.copy(),
            contacts=contacts[rows].copy(),
            action=next(clip.action for clip in self.clips if clip.name == name),
        )


def write_pack(path: Path, clips: Sequence[tuple[LibraryClip, Motion]]) -> None:
    """Write one file of the library.

    Raises
    ------
    ValueError
        There is no clip, or motions have other joints, rates or bones than the first one, or no contacts.
    """
    if not clips:
        raise ValueError("clips is empty: a library file has at least one")
    first = clips[0][1]
    for clip, motion in clips:
        if motion.joint_names != JOINT_NAMES[:NUM_BODY_JOINTS] or not np.array_equal(motion.offsets, first.offsets):
            raise ValueError(f"clip '{clip.name}' has other joints or bones than '{clips[0][0].name}'")
        if motion.frame_rate != first.frame_rate or len(motion.translation) != clip.frames or motion.contacts is None:
            raise ValueError(f"clip '{clip.name}' has another rate or length than its record, or no contacts")
    rotations, translations = [], []
    for _, motion in clips:
        vectors = Rotation.from_quat(motion.rotations.reshape(-1, 4)).as_rotvec().reshape(len(motion.translation), -1)
        steps = np.clip(np.rint(vectors / _ANGLE), -(1 << 15), (1 << 15) - 1)
        rotations.append(_differences(steps.astype(np.int16)))
        translations.append(_differences(np.rint(motion.translation / _LENGTH).astype(np.int32)))
    np.savez_compressed(
        path,
        rotations=np.concatenate(rotations),
        translations=np.concatenate(translations),
        contacts=np.packbits(np.concatenate([np.asarray(motion.contacts) for _, motion in clips]), axis=0),
        offsets=np.asarray(first.offsets, dtype=np.float64),
        frame_rate=first.frame_rate,
        clips=np.frombuffer(json.dumps([vars(clip) for clip, _ in clips]).encode(), np.uint8),
    )


def _differences(values: NDArray[Any]) -> NDArray[Any]:
    """Second differences (frame, ...), in the arithmetic of the type, which wraps."""
    first = np.diff(values, axis=0, prepend=np.zeros_like(values[:1]))
    return np.diff(first, axis=0, prepend=np.zeros_like(values[:1]))


def _integrated(values: NDArray[Any]) -> NDArray[Any]:
    """Inverse of :func:`_differences`."""
    for _ in range(2):
        values = np.cumsum(values, axis=0, dtype=values.dtype)
    return values


def _continuous(quaternions: FloatArray) -> FloatArray:
    """(frame, joint, 4) of signs without jumps."""
    turns = np.sum(quaternions[1:] * quaternions[:-1], axis=-1) < 0
    signs = np.where(np.cumsum(turns, axis=0) % 2, -1.0, 1.0)
    quaternions[1:] *= signs[..., None]
    return quaternions


def _clip(record: dict[str, Any]) -> LibraryClip:
    values = {field.name: record[field.name] for field in fields(LibraryClip)}
    return LibraryClip(**values | {"captions": tuple(record["captions"])})
