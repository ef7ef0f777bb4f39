"""Training of the motion model goes on where it stopped, leaves held-out people out, and learns."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from rfgen_sionna.generative.diffusion.pose_rows import NUM_COLUMNS, NUM_CONTEXT, pose_rows
from rfgen_sionna.generative.diffusion.variation_model import read_model
from rfgen_sionna.generative.diffusion.variation_net import NetworkShape, stems, word_indices
from rfgen_sionna.generative.motion import KinematicSource
from rfgen_sionna.generative.motion.clip_editing import mirrored as mirrored_motion
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, NUM_BODY_JOINTS
from rfgen_sionna.generative.motion_library import LibraryClip, MotionLibrary, write_pack
from rfgen_sionna.records import Motion
from training.motion import row_corpus
from training.motion.row_corpus import HELD_OUT, Entry, RowCorpus, build, mirrored
from training.motion.variation_training import LENGTHS, Batches, VariationRecipe, train

_SMALL = NetworkShape((16, 24), 3, 16)


def body_alone(motion: Motion) -> Motion:
    """Without fingers, as clips of the library."""
    return Motion(
        motion.rotations[:, :NUM_BODY_JOINTS],
        motion.translation,
        motion.frame_rate,
        JOINT_NAMES[:NUM_BODY_JOINTS],
        motion.parents[:NUM_BODY_JOINTS],
        motion.offsets[:NUM_BODY_JOINTS],
        motion.contacts,
    )


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> MotionLibrary:
    """Three clips: two walks of one person, one of a held-out one."""
    folder = tmp_path_factory.mktemp("library")
    clips = []
    for k, subject in enumerate(("somebody", "somebody", HELD_OUT[0])):
        motion = body_alone(KinematicSource(20.0)("walk", 7.0, k))
        frames = len(motion.translation)
        captions = ("a person walks to the left",)
        record = LibraryClip(f"walk{k}", "walk", captions, "none", "here", subject, "mocap", frames, 20.0)
        clips.append((record, motion))
    write_pack(folder / "own.npz", clips)
    return MotionLibrary(folder)


@pytest.fixture(scope="module")
def corpus(library: MotionLibrary) -> RowCorpus:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(row_corpus, "ACTIONS", {name: row_corpus.ACTIONS[name] for name in ("t_pose", "push")})
        return build(library, rules=2)


def test_held_out_people_are_not_in_the_training_set(corpus: RowCorpus) -> None:
    """Two clips and their mirror images, two motions by each of two rules."""
    captured = [entry for entry in corpus.entries if not entry.by_rules]
    assert len(captured) == 4
    assert {entry.subject for entry in captured} == {"somebody"}
    assert len(corpus.entries) == 8
    assert {"walk", "left", "right"} <= set(corpus.vocabulary)


def test_held_out_people_are_an_eighth_of_the_library() -> None:
    library = MotionLibrary()
    share = sum(c.frames for c in library if c.subject in HELD_OUT) / sum(c.frames for c in library)
    assert 0.08 < share < 0.16
    assert set(HELD_OUT) <= {clip.subject for clip in library}


def test_the_mirror_image_of_rows_is_that_of_the_motion() -> None:
    motion = KinematicSource(20.0)("push", 3.0, 1)
    rows, context = pose_rows(motion)
    entry = mirrored(Entry(rows.astype(np.float32), context.astype(np.float32), "left_kick", ("a left kick",), "x"))
    other, others_context = pose_rows(mirrored_motion(body_alone(motion)))
    assert np.allclose(entry.rows, other, atol=1e-5)
    assert np.allclose(entry.context, others_context, atol=1e-4)
    assert entry.captions == ("a right kick",)
    assert entry.action == "right_kick"


def test_batches_are_of_their_number_alone(corpus: RowCorpus) -> None:
    batches = Batches(corpus, VariationRecipe(items=3))
    noisy, goal, context, level, words = batches.batch(7)
    assert noisy.shape == goal.shape
    assert noisy.shape[1] in LENGTHS
    assert noisy.shape[2] == NUM_COLUMNS
    assert context.shape[2] == NUM_CONTEXT
    assert words.shape[0] == level.shape[0] == 3
    assert all(
        bool((a == b).all()) for a, b in zip(batches.batch(7), (noisy, goal, context, level, words), strict=True)
    )


def test_a_stopped_training_goes_on_to_the_same_weights(corpus: RowCorpus, tmp_path: Path) -> None:
    recipe = VariationRecipe(steps=4, items=2)
    whole = train(corpus, tmp_path / "whole", recipe, shape=_SMALL, save_every=2)
    train(corpus, tmp_path / "parts", VariationRecipe(steps=2, items=2), shape=_SMALL, save_every=2)
    parts = train(corpus, tmp_path / "parts", recipe, shape=_SMALL, save_every=2)
    a, b = read_model(whole), read_model(parts)
    assert a.facts["steps"] == b.facts["steps"] == 4
    # the learning rate falls by the number of steps, so that the first two were not quite the same
    for one, other in zip(a.net.parameters(), b.net.parameters(), strict=True):
        assert np.allclose(one.numpy(), other.numpy(), atol=5e-3)
    assert a.vocabulary == corpus.vocabulary
    assert np.allclose(a.noise.factor, corpus.noise.factor, atol=1e-5)
    with pytest.raises(ValueError, match="was made with"):
        train(corpus, tmp_path / "parts", VariationRecipe(steps=4, items=3), shape=_SMALL)


def test_a_network_learns(corpus: RowCorpus, tmp_path: Path) -> None:
    """The loss falls by a third in a hundred steps, of a few motions."""
    train(corpus, tmp_path, VariationRecipe(steps=100, items=4, rate=5e-3), shape=_SMALL, save_every=2)
    losses = [json.loads(line)["plain"] for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    assert np.mean(losses[-10:]) < 0.67 * np.mean(losses[:5])


def test_files_of_other_models_are_refused(tmp_path: Path) -> None:
    from safetensors.numpy import save_file

    save_file({"x": np.zeros(1, np.float32)}, tmp_path / "other.safetensors", {"rfgen": '{"format": "rfgen-motion-1"}'})
    with pytest.raises(ValueError, match="rfgen-motion-1"):
        read_model(tmp_path / "other.safetensors")
    with pytest.raises(FileNotFoundError, match=r"none\.safetensors"):
        read_model(tmp_path / "none.safetensors")


def test_words_are_known_by_their_stems() -> None:
    assert stems("A person KICKS, kicking twice!") == ["a", "person", "kick", "kick", "twic"]
    assert word_indices(["kicks a ball", "", "unknown"], ("a", "kick")).tolist() == [[2, 1], [0, 0], [0, 0]]
