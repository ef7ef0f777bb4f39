"""Captured motion that ships with the package: names, captions, terms, poses."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rfgen_sionna.generative import Actor, MotionLibrary
from rfgen_sionna.generative.motion import KinematicSource
from rfgen_sionna.generative.motion.skeleton import NUM_BODY_JOINTS
from rfgen_sionna.generative.motion_library import FOLDER, LibraryClip, write_pack
from rfgen_sionna.records import Motion
from rfgen_sionna.show.stick_figures import body_joints, draw_stick_figures


@pytest.fixture(scope="module")
def library() -> MotionLibrary:
    return MotionLibrary()


def test_every_clip_has_words_terms_and_a_length(library: MotionLibrary) -> None:
    assert len(library) == len({clip.name for clip in library}) > 1000
    assert sum(clip.duration for clip in library) > 100 * 60
    card = (FOLDER / "README.md").read_text()
    for clip in library:
        assert clip.captions
        assert clip.action
        assert clip.kind in ("mocap", "keyframed", "simulated", "edited")
        assert f"**{clip.licence}**" in card


def test_share_alike_clips_have_a_file_of_their_own() -> None:
    for path in FOLDER.glob("*.npz"):
        with np.load(path) as stored:
            text = stored["clips"].tobytes().decode()
        assert ("CC-BY-SA-3.0" in text) == (path.stem == "hdm05")
        assert path.stem != "hdm05" or text.count('"licence": "CC-BY-SA-3.0"') == text.count('"licence"')


def test_the_library_is_small() -> None:
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < 20e6


@pytest.mark.parametrize("words", ["kick", "lies down", "CRAWL"])
def test_words_find_clips(library: MotionLibrary, words: str) -> None:
    found = library.search(words)
    assert found
    assert all(
        word in f"{clip.name} {clip.action} {clip.captions}".lower() for clip in found for word in words.lower().split()
    )


@pytest.mark.parametrize("action", ["walk", "kick", "lie_down", "crawl", "squat", "cartwheel"])
def test_people_are_on_the_floor(library: MotionLibrary, action: str) -> None:
    for clip in library.actions[action][:4]:
        places = body_joints(library.motion(clip.name))
        assert places.shape == (clip.frames, NUM_BODY_JOINTS, 3)
        lowest = places[..., 2].min(axis=1)
        assert -0.1 < lowest.min() < 0.1
        if action == "lie_down":
            assert places[..., 2].max(axis=1).min() < 0.5
        if action == "walk":
            assert np.median(places[:, 15, 2]) > 1.3


def test_steps_between_poses_are_those_of_people(library: MotionLibrary) -> None:
    for clip in library.clips[::40]:
        motion = library.motion(clip.name)
        steps = np.linalg.norm(np.diff(body_joints(motion), axis=0), axis=-1) * motion.frame_rate
        assert steps.max() < 20.0
        assert np.abs(np.linalg.norm(motion.rotations, axis=-1) - 1).max() < 1e-9
        assert np.sum(motion.rotations[1:] * motion.rotations[:-1], axis=-1).min() > 0


def test_an_unknown_clip_is_answered_with_near_ones(library: MotionLibrary) -> None:
    with pytest.raises(KeyError, match="no clip 'boxing' in the library; near it: "):
        library.motion("boxing")


def test_a_clip_moves_a_body(library: MotionLibrary) -> None:
    clip = library.search("squat")[0]
    actor = Actor.from_motion(library.motion(clip.name))
    heights = [float(np.ptp(actor.vertices(t)[:, 2])) for t in np.linspace(0, clip.duration, 12)]
    assert min(heights) < 0.85 * max(heights)


def entry(name: str, seed: int) -> tuple[LibraryClip, Motion]:
    motion = KinematicSource(20.0)("walk", 2.0, seed)
    body = replace(
        motion,
        rotations=motion.rotations[:, :NUM_BODY_JOINTS],
        joint_names=motion.joint_names[:NUM_BODY_JOINTS],
        parents=motion.parents[:NUM_BODY_JOINTS],
        offsets=motion.offsets[:NUM_BODY_JOINTS],
    )
    frames = len(body.translation)
    return LibraryClip(name, "walk", ("a person walks",), "CC0-1.0", "here", "nobody", "mocap", frames, 20.0), body


def test_a_written_pack_is_read_back_to_a_hundredth_of_a_degree(tmp_path: Path) -> None:
    entries = [entry("one", 0), entry("two", 1)]
    write_pack(tmp_path / "own.npz", entries)
    library = MotionLibrary(tmp_path)
    assert library.clips == tuple(clip for clip, _ in entries)
    for clip, motion in entries:
        again = library.motion(clip.name)
        assert body_joints(again) == pytest.approx(body_joints(motion), abs=5e-4)
        assert np.abs(np.sum(again.rotations * motion.rotations, axis=-1)).min() > np.cos(np.radians(0.01) / 2)
        assert np.array_equal(again.contacts, motion.contacts)
        assert again.action == "walk"


def test_clips_of_different_bones_do_not_go_into_one_file(tmp_path: Path) -> None:
    (clip, motion), (other, second) = entry("one", 0), entry("two", 1)
    with pytest.raises(ValueError, match="other joints or bones"):
        write_pack(tmp_path / "own.npz", [(clip, motion), (other, replace(second, offsets=1.1 * second.offsets))])
    with pytest.raises(ValueError, match="at least one"):
        write_pack(tmp_path / "own.npz", [])
    with pytest.raises(FileNotFoundError, match="no library"):
        MotionLibrary(tmp_path)


def test_motions_are_drawn(library: MotionLibrary, tmp_path: Path) -> None:
    clips = library.search("kick")[:2]
    draw_stick_figures({clip.name: library.motion(clip.name) for clip in clips}, tmp_path / "kicks.png")
    from PIL import Image

    with Image.open(tmp_path / "kicks.png") as picture:
        assert picture.size == (750, 350)
        assert len(picture.convert("RGB").getcolors(2**24)) > 50
