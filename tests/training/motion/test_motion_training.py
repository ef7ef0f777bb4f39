"""Losses vanish at the truth, runs can be taken up again, the mocap pack lands on our skeleton."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from rfgen_sionna.generative.diffusion import features as rows_of
from rfgen_sionna.generative.diffusion.checkpoint import read_model
from rfgen_sionna.generative.diffusion.features import PARTS, encode, joint_positions, replace_parts
from rfgen_sionna.generative.diffusion.network import NetworkShape
from rfgen_sionna.generative.diffusion.phrasebook import CLAUSES
from rfgen_sionna.generative.diffusion.sentence_encoder import TextEncoder
from rfgen_sionna.generative.motion import MEAN_ADULT, PARENTS, KinematicSource
from rfgen_sionna.generative.motion.skeleton import JOINT, JOINT_NAMES, NUM_BODY_JOINTS
from training.motion.batches import LENGTHS, BatchSampler, hide
from training.motion.joint_loss import geometric_loss
from training.motion.joint_loss import joint_positions as torch_positions
from training.motion.kinematic_clips import read_clips, synthesise
from training.motion.mocap import read_pack
from training.motion.motion_corpus import MotionCorpus, fit_hands, held_out
from training.motion.motion_text import Captions, train_text
from training.motion.motion_training import MotionRecipe, train

_TO_PACK = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


@pytest.fixture(scope="module")
def pack(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A pack of two clips in its own axes (y up, facing z), made from a synthesised walk on the mean adult."""
    from rfgen_sionna.generative.motion.rotations import to_matrices, to_quaternions

    folder = tmp_path_factory.mktemp("pack")
    motion = KinematicSource(20.0)("walk", 9.0, 2)
    local = _TO_PACK @ to_matrices(motion.rotations[:, :NUM_BODY_JOINTS]) @ _TO_PACK.T
    n = len(local)
    np.savez(
        folder / "motions.npz",
        quat=np.tile(np.roll(to_quaternions(local), 1, axis=-1), (2, 1, 1)).astype(np.float32),
        trans=np.tile(motion.translation @ _TO_PACK.T, (2, 1)).astype(np.float32),
        offsets=MEAN_ADULT.offsets[:NUM_BODY_JOINTS] @ _TO_PACK.T,
        parents=np.array(PARENTS[:NUM_BODY_JOINTS]),
        fps=20.0,
    )
    records = [
        {"name": f"clip{k}", "start": k * n, "frames": n, "action": "march", "captions": ["a person marches left"],
         "licence": "none", "subject": "nobody", "source": "here", "kind": "mocap"}
        for k in range(2)
    ]  # fmt: skip
    (folder / "clips.json").write_text(json.dumps(records), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory, pack: Path) -> MotionCorpus:
    from dataclasses import replace

    from training.motion import motion_corpus as corpus_module
    from training.motion.motion_corpus import Entry, beats_of

    motions = {a: [KinematicSource(20.0)(a, 8.0, s) for s in range(2)] for a in ("walk", "standing", "push", "t_pose")}
    hands = fit_hands(motions["standing"], [m for group in motions.values() for m in group])
    entries = [
        Entry(encode(m, hands).astype(np.float16), np.zeros((161, 3), np.float16), (a,), "kinematic", f"{a}/{k}")
        for a, group in motions.items()
        for k, m in enumerate(group)
    ]
    entries += [replace(e, held_out=False) for e in corpus_module.captured(read_pack(pack), hands)]
    mean, scale = corpus_module._statistics(entries)
    return MotionCorpus(tuple(entries), hands, beats_of(entries), mean, scale)


def test_positions_agree_with_the_arrays() -> None:
    motion = KinematicSource(20.0)("jumping_jacks", 2.0, 0)
    rows = encode(motion, fit_hands([motion], [motion]))
    theirs = torch_positions(torch.from_numpy(rows)).numpy() + rows[:, None, rows_of.ROOT]
    assert np.allclose(theirs, joint_positions(rows), atol=1e-9)


def test_the_geometric_loss_vanishes_at_the_truth_and_sees_each_fault() -> None:
    motion = KinematicSource(20.0)("standing", 2.0, 0)
    rows = torch.from_numpy(encode(motion, fit_hands([motion], [motion])))[None]
    none = float(geometric_loss(rows, rows))
    for column, by in (
        (rows_of.ROOT.start, 0.1),
        (rows_of.TRACKED_POSITIONS.start, 0.1),
        (rows_of.LOCAL.start + 1, 0.5),
    ):
        wrong = rows.clone()
        wrong[..., column] += by
        assert float(geometric_loss(wrong, rows)) > none + 1e-3
    shaking = rows.clone()
    shaking[:, ::2, 0] += 0.02
    shifted = rows.clone()
    shifted[..., 0] += 0.01
    assert float(geometric_loss(shaking, rows)) > float(geometric_loss(shifted, rows))
    # quiet standing: what is left is the sway of planted feet
    assert none < 0.01


def test_the_pack_comes_back_in_our_frame(pack: Path) -> None:
    original = KinematicSource(20.0)("walk", 9.0, 2)
    capture = read_pack(pack)[0]
    assert capture.action == "march"
    assert capture.motion.joint_names == JOINT_NAMES[:NUM_BODY_JOINTS]
    assert np.allclose(capture.motion.translation[:, :2], original.translation[:, :2], atol=1e-6)
    hands = fit_hands([original], [original])
    places = [joint_positions(encode(m, hands)) for m in (capture.motion, original)]
    # legs reach for scaled ankles by inverse kinematics; the pelvis may be put on the floor anew
    lift = places[0][0, 0, 2] - places[1][0, 0, 2]
    assert abs(lift) < 0.02
    assert np.abs(places[0] - places[1] - [0.0, 0.0, lift]).max() < 0.01
    # planted is what is low and slow, which the synthesiser knows without looking
    assert (capture.motion.contacts == original.contacts).mean() > 0.8


def test_a_pack_without_its_files_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"motions\.npz"):
        read_pack(tmp_path)


def test_mirrored_captures_say_the_other_side(corpus: MotionCorpus) -> None:
    said = {e.name: e.captions[0] for e in corpus.entries if e.source == "mocap"}
    assert said["clip0"] == "a person marches left"
    assert said["clip0/mirrored"] == "a person marches right"


def test_clips_are_split_by_name_alone() -> None:
    share = np.mean([held_out(f"walk/{k}") for k in range(4000)])
    assert share == pytest.approx(0.12, abs=0.02)


def test_batches_come_from_their_number(corpus: MotionCorpus) -> None:
    feeder = BatchSampler(corpus, seed=1, items=4)
    a, b, c = feeder.batch(3), BatchSampler(corpus, seed=1, items=4).batch(3), feeder.batch(4)
    assert np.array_equal(a.clean, b.clean)
    assert a.prompts == b.prompts
    assert a.clean.shape[1] in LENGTHS
    assert a.clean.shape != c.clean.shape or not np.array_equal(a.clean, c.clean)


def test_what_is_given_is_true_and_the_rest_is_hidden() -> None:
    rng = np.random.default_rng(0)
    clean = rng.standard_normal((64, rows_of.NUM_FEATURES))
    kinds = set()
    for _ in range(200):
        known, given = hide(rng, clean, np.ones(rows_of.NUM_FEATURES))
        kinds.add(tuple(np.unique(given)))
        for k, columns in enumerate(PARTS.values()):
            values = known[:, list(columns)]
            assert not values[given[:, k] == 0.0].any()
            exact = given[:, k] == 1.0
            assert np.array_equal(values[exact], clean[exact][:, list(columns)])
    assert {(0.0,), (0.0, 1.0), (0.0, 0.5)} <= kinds


def test_arms_of_one_clip_go_on_another() -> None:
    walk, pose = (KinematicSource(20.0)(a, 3.0, 0) for a in ("walk", "left_arm_raised"))
    hands = fit_hands([walk], [walk, pose])
    base, other = encode(walk, hands), encode(pose, hands)
    mixed = replace_parts(base, other, ["left_arm"])
    places, plain = joint_positions(mixed), joint_positions(base)
    assert (places[:, JOINT["left_wrist"], 2] > places[:, JOINT["head"], 2]).mean() > 0.6
    assert np.array_equal(places[:, JOINT["right_wrist"]], plain[:, JOINT["right_wrist"]])
    assert np.allclose(
        encode(rows_of.decode(mixed, hands, 20.0), hands)[:, rows_of.TRACKED_POSITIONS],
        mixed[:, rows_of.TRACKED_POSITIONS],
    )


def test_a_stopped_run_is_taken_up_where_it_was(tmp_path: Path, corpus: MotionCorpus) -> None:
    torch.manual_seed(0)
    text = TextEncoder(tuple(CLAUSES)).eval().requires_grad_(False)
    shape = NetworkShape(channels=(16, 24, 32))
    whole = train(corpus, text, tmp_path / "a", MotionRecipe(steps=4, items=2), shape=shape, save_every=2)
    seen: list[int] = []
    # a run of four steps that is stopped after two: the recipe is the same, so is its learning rate
    with pytest.raises(KeyboardInterrupt):
        train(
            corpus,
            text,
            tmp_path / "b",
            MotionRecipe(steps=4, items=2),
            shape=shape,
            save_every=2,
            progress=_stop_after(3),
        )
    parts = train(
        corpus, text, tmp_path / "b", MotionRecipe(steps=4, items=2), shape=shape, save_every=2,
        progress=lambda step, *_: seen.append(step),
    )  # fmt: skip
    assert seen == [3, 4]
    a, b = (dict(read_model(p).net.named_parameters()) for p in (whole, parts))
    assert max(float((a[k] - b[k]).abs().max()) for k in a) < 2e-3
    with pytest.raises(ValueError, match="another folder"):
        train(corpus, text, tmp_path / "a", MotionRecipe(steps=4, items=3), shape=shape)


@pytest.mark.slow
def test_the_seed_decides_a_whole_training(tmp_path: Path, corpus: MotionCorpus) -> None:
    """Sentence encoder and motion model, twenty steps each, on one thread: the same file, byte by byte."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:

        def run(name: str, seed: int) -> bytes:
            text = train_text([Captions("march", ("a person marches on",))], seed=seed, steps=20, batch=16)
            recipe = MotionRecipe(steps=20, items=4, seed=seed, movement_from=10)
            text = text.eval().requires_grad_(False)
            path = train(corpus, text, tmp_path / name, recipe, shape=NetworkShape(channels=(16, 24, 32)))
            model = read_model(path)
            return b"".join(v.numpy().tobytes() for m in (model.net, model.text) for v in m.state_dict().values())

        first = run("first", 3)
        assert run("second", 3) == first
        assert run("third", 4) != first
    finally:
        torch.set_num_threads(threads)


def _stop_after(limit: int):
    def progress(step: int, *_: float) -> None:
        if step >= limit:
            raise KeyboardInterrupt

    return progress


def test_the_sentence_encoder_learns() -> None:
    losses: list[float] = []
    captured = [Captions("march", ("a person marches on",))]
    model = train_text(captured, steps=12, batch=24, progress=lambda _s, _n, loss: losses.append(loss))
    assert "march" in model.actions
    assert losses[-1] < losses[0]


def test_clips_are_written_once_and_read_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from training.motion import kinematic_clips as synthesis

    monkeypatch.setattr(synthesis, "CLAUSES", {"push": ()})
    monkeypatch.setattr(synthesis, "_BLOCK", 2)
    monkeypatch.setattr(synthesis, "CLIP_SECONDS", 1.0)
    files = synthesise(tmp_path, 2, seed=4)
    clips = [clip for path in files for clip in read_clips(path)]
    assert [c.hand for c in clips] == ["left", "right"]
    assert clips[0].seed != clips[1].seed
    again = KinematicSource(20.0)("push", 1.0, clips[0].seed, hand="left", speed=clips[0].speed)
    assert np.allclose(clips[0].motion.rotations, again.rotations, atol=1e-6)
    stamp = files[0].stat().st_mtime_ns
    assert synthesise(tmp_path, 2, seed=4) == files
    assert files[0].stat().st_mtime_ns == stamp
