"""A person of a prompt who moves as a clip does: the prompt has the person and the place, the clip the motion."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.generative.clip_person import chosen_clip, clip_name, read_clip_prompt
from rfgen_sionna.generative.motion.kinematic import KinematicSource
from rfgen_sionna.generative.prompts import PromptError

WALK = Path("somewhere/walk 3.bvh")


def test_a_motion_is_a_source_by_name_or_a_clip(tmp_path: Path) -> None:
    (tmp_path / "wave.npz").touch()
    (tmp_path / "meshes").mkdir()
    for name in ("auto", "kinematic", "diffusion", "difusion"):
        assert chosen_clip(name) is None
    for path in (tmp_path / "wave.npz", str(tmp_path / "wave.npz"), str(tmp_path / "meshes")):
        assert chosen_clip(path, up="y", frame_rate=30.0) == Path(path)
    motion = KinematicSource()("jump", 1.0, 0)
    assert chosen_clip(motion) is motion
    assert (clip_name(motion), clip_name(tmp_path / "wave.npz"), clip_name(tmp_path / "meshes")) == (
        "jump",
        "wave",
        "meshes",
    )


@pytest.mark.parametrize("name", ["clip.npz", "folder/clip", Path("clip")])
def test_a_clip_that_is_missing(name: Any) -> None:
    with pytest.raises(FileNotFoundError, match=r"motion: there is no file or folder '(clip|folder)"):
        chosen_clip(name)


def test_options_of_a_clip_belong_to_a_file() -> None:
    with pytest.raises(ValueError, match=r"up is 'y', which belongs to a clip in a file, but motion is 'auto'"):
        chosen_clip("auto", up="y")
    with pytest.raises(ValueError, match=r"frame_rate is 30, which belongs .* but motion is a Motion"):
        chosen_clip(KinematicSource()("jump", 1.0, 0), frame_rate=30)
    with pytest.raises(TypeError, match="motion is 3: "):
        chosen_clip(3)


@pytest.mark.parametrize("prompt", ["", "a person", "a person 2 m away", "a tall woman, facing left, at 2 m"])
def test_a_prompt_needs_no_action(prompt: str) -> None:
    said = read_clip_prompt(prompt, "", 0, WALK)
    assert said.action == "clip: walk 3"
    assert said.distance_m == (2.0 if "2 m" in prompt else None)
    assert said.orientation_deg == (90.0 if "left" in prompt else None)
    assert (said.body.gender == "female") == ("woman" in prompt)
    assert not said.warnings


def test_an_action_of_the_prompt_is_not_claimed() -> None:
    said = read_clip_prompt("a man raises the left arm, wearing a hat, at 2 m", "", 0, WALK)
    assert said.action == "clip: walk 3"
    assert said.hand is None
    assert any("has no effect: motion is the clip 'walk 3'" in note for note in said.notes)
    assert any("hat' was not understood" in sentence for sentence in said.warnings)
    assert "clip: walk 3" in said.report()
    assert "raises the left arm  from" not in said.report()


def test_a_speed_is_the_clip_s_own() -> None:
    with pytest.raises(PromptError, match="speed: the prompt gives it, but the clip 'walk 3' has its own"):
        read_clip_prompt("a person walks slowly", "", 0, WALK)


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Half a second of a body of AMASS (z up) that stands and goes 0.25 m ahead."""
    path = tmp_path_factory.mktemp("clips") / "glide.npz"
    poses = np.zeros((16, 72))
    poses[:, :3] = [np.pi / 2, 0, 0]  # SMPL's rest body stands along y
    trans = np.zeros((16, 3))
    trans[:, 1] = np.linspace(0.0, -0.25, 16)
    np.savez(path, poses=poses, trans=trans, mocap_framerate=30.0)
    return path


def test_the_person_stands_where_the_prompt_says(clip: Path, tiny_toml: Path) -> None:
    pytest.importorskip("anny", reason="people need the body model")
    from rfgen_sionna.generative.clip_person import person_with_clip
    from rfgen_sionna.radar import Radar

    radar = Radar.load(tiny_toml, position=(0, 0, 1), look_at=(3, 0, 1))
    said = read_clip_prompt("a woman 1.7 m tall, at azimuth 20 degrees, 2 m away", "", 0, clip)
    person = person_with_clip(said, clip, seed=0, radar=radar, floor=0.1)
    place = person.vertices(0.0)
    assert person.action == "clip: glide"
    assert person.duration == pytest.approx(0.5)
    assert np.ptp(place[:, 2]) == pytest.approx(1.7, abs=0.05)
    assert place[:, 2].min() == pytest.approx(0.1, abs=0.03)
    wanted = 2.0 * np.array([np.cos(np.radians(20)), np.sin(np.radians(20))])
    np.testing.assert_allclose(person.pose(0.0)[0], [*wanted, 0.1], atol=1e-9)
    np.testing.assert_allclose(person.joints(0.0)[0, :2], wanted, atol=0.15)
    went = person.joints(0.5)[0] - person.joints(0.0)[0]
    assert np.linalg.norm(went[:2]) == pytest.approx(0.25, abs=0.02)
    facing = -wanted / 2.0  # the radar, as the clip goes the way it faces
    assert went[:2] @ facing == pytest.approx(0.25, abs=0.02)
    report = person.report()
    assert "glide.npz" in report
    assert "speed" not in report
    assert any(each.value == "1.70 m" for each in person.decisions if each.name == "height")


def test_a_mesh_is_a_body_of_its_own(tmp_path: Path, tiny_toml: Path, caplog: pytest.LogCaptureFixture) -> None:
    import trimesh

    from rfgen_sionna.generative.clip_person import person_with_clip
    from rfgen_sionna.radar import Radar

    radar = Radar.load(tiny_toml, position=(0, 0, 1), look_at=(3, 0, 1))
    for number in range(5):
        ball = trimesh.creation.icosphere(subdivisions=1, radius=0.2)
        ball.apply_translation((0, 0, 1 + 0.01 * number))
        ball.export(tmp_path / f"frame{number}.ply")
    options: dict[str, Any] = {"seed": 0, "radar": radar, "floor": 0.0, "frame_rate": 10.0}
    person = person_with_clip(read_clip_prompt("a man, 2 m away", "", 0, tmp_path), tmp_path, **options)
    assert person.vertices(0.0)[:, 0].mean() == pytest.approx(2.0, abs=1e-6)
    assert "gender and age have no effect" in caplog.text
    with pytest.raises(PromptError, match=r"gives the person's height, but the clip '.*' is a body of its own"):
        person_with_clip(read_clip_prompt("a tall man, 2 m away", "", 0, tmp_path), tmp_path, **options)
