"""Every example of docs/bring-your-own.md runs as it stands, in a folder with the files that it names."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.generative import MotionLibrary
from rfgen_sionna.generative.motion.skeleton import JOINT
from rfgen_sionna.show.stick_figures import body_joints

ROOT = Path(__file__).resolve().parents[2]
BREATH = 0.25
CFG = """sensorStop
flushCfg
dfeDataOutputMode 1
channelCfg 15 7 0
adcCfg 2 1
adcbufCfg -1 0 1 1 1
profileCfg 0 60.25 30 7 57.14 0 0 60 1 64 2000 0 0 30
chirpCfg 0 0 0 0 0 0 0 1
chirpCfg 1 1 0 0 0 0 0 2
chirpCfg 2 2 0 0 0 0 0 4
frameCfg 0 2 16 0 50 1 0
sensorStart
"""


def examples() -> dict[str, list[str]]:
    """Code of each section of the page."""
    sections = re.split(r"^## ", (ROOT / "docs" / "bring-your-own.md").read_text(), flags=re.M)[1:]
    return {text.splitlines()[0]: re.findall(r"```python\n(.*?)```", text, flags=re.S) for text in sections}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def names(folder: Path) -> dict[str, Any]:
    """Names that earlier sections of the page define."""
    radar = rfgen.Radar.load("awr1843", position=(0, 0, 1), look_at=(3, 0, 1), overrides={"preset.mmmesh.num_loops": 8})
    ball = trimesh.creation.icosphere(2, radius=0.1)
    return {"rfgen": rfgen, "radar": radar, "chair": rfgen.Actor.from_mesh(ball, material="metal", position=(2, 0, 1))}


def run(section: str, names: dict[str, Any]) -> dict[str, Any]:
    for code in examples()[section]:
        exec(compile(code, f"docs/bring-your-own.md, {section}", "exec"), names)
    return names


def test_every_section_has_an_example() -> None:
    assert list(examples()) == ["Radar", ".cfg", "Capture", "Motion", "Joints", "Mesh", "Scene", "Material"]
    assert all(examples().values())


def test_radar(folder: Path, names: dict[str, Any]) -> None:
    text = (ROOT / "radars" / "awr1843.toml").read_text()
    (folder / "my_radar.toml").write_text(text[: text.index("\n[source]")].replace("num_loops = 128", "num_loops = 8"))
    corner = trimesh.creation.icosphere(3, radius=0.05)
    target = rfgen.Actor.from_mesh(corner, material="metal", position=(2.0, 0.2, 1.1))
    rfgen.Simulator(None, names["radar"], [target]).record("corner.h5", duration=0.2)
    found = run("Radar", names)
    assert found["cooler"].noise_figure_db == 10.0
    assert found["names"] == ("TX1", "TX3", "TX2")
    assert np.array_equal(found["samples"][:, :, 2], found["cube"].data[:, :, 1])
    points = found["points"]
    strongest = points.position[np.argmax(points.power)]
    assert strongest == pytest.approx((1.95, 0.195, 1.098), abs=0.1)


def test_cfg(folder: Path, names: dict[str, Any]) -> None:
    (folder / "profile.cfg").write_text(CFG)
    found = run(".cfg", names)
    assert found["radar"].name == "iwr6843isk"
    assert found["radar"].waveform.start_frequency == 60.25e9
    (folder / "again.cfg").write_text(found["text"])
    assert rfgen.Radar.load("again.cfg", board="iwr6843isk").waveform == found["radar"].waveform


def test_capture(folder: Path, names: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    """A chest of 4 mm at 0.33 m, in the words of a real board: 12 bits about the middle of the range."""
    frames, period = 160, 0.0772688
    radar = rfgen.Radar.load("bgt60tr13c", preset="breathing")
    wave, fast = radar.waveform, np.arange(64) / 2e6
    range_ = 0.33 + 4e-3 * np.sin(2 * np.pi * BREATH * period * np.arange(frames))
    tau = 2 * range_ / 299_792_458.0
    phase = wave.start_frequency * tau[:, None] + wave.slope * tau[:, None] * fast
    words = 2048 + 200 * np.cos(2 * np.pi * phase) + np.random.default_rng(0).normal(0, 3, phase.shape)
    (folder / "bgt60").mkdir()
    np.save("bgt60/radar.npy", np.broadcast_to(np.rint(words)[:, None, None], (frames, 3, 8, 64)).astype(np.uint16))
    shape = {
        "aaf_cutoff_Hz": 500000, "chirp_repetition_time_s": 0.000591125, "end_frequency_Hz": 63500000000,
        "frame_repetition_time_s": period, "hp_cutoff_Hz": 80000, "if_gain_dB": 23, "mimo_mode": "off",
        "num_chirps_per_frame": 8, "num_samples_per_chirp": 64, "rx_antennas": [1, 2, 3], "sample_rate_Hz": 2000000,
        "start_frequency_Hz": 58000000000, "tx_antennas": [1], "tx_power_level": 31,
    }  # fmt: skip
    (folder / "bgt60" / "config.json").write_text(json.dumps({"device_config": {"fmcw_single_shape": shape}}))
    found = run("Capture", names)
    assert found["chest"].range == pytest.approx(0.33, abs=0.02)
    assert found["chest"].rate() == pytest.approx(BREATH, abs=0.02)
    assert "0.33 m, 0.25 breaths a second" in capsys.readouterr().out


def bvh(path: Path) -> None:
    """One arm of a standing figure goes up and down."""
    path.write_text(
        """HIERARCHY
ROOT Hips
{
OFFSET 0 0 0
CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
"""
        + joint("Spine", (0, 12, 0), joint("Neck", (0, 38, 0), joint("Head", (0, 12, 0), end((0, 15, 0)))), limbs())
        + leg("Left", 9)
        + leg("Right", -9)
        + "}\nMOTION\nFrames: 40\nFrame Time: 0.05\n"
        + "\n".join(frame(k) for k in range(40))
        + "\n"
    )


def joint(name: str, offset: tuple[float, float, float], *children: str) -> str:
    body = "".join(children)
    place = " ".join(map(str, offset))
    return f"JOINT {name}\n{{\nOFFSET {place}\nCHANNELS 3 Zrotation Xrotation Yrotation\n{body}}}\n"


def end(offset: tuple[float, float, float]) -> str:
    return f"End Site\n{{\nOFFSET {' '.join(map(str, offset))}\n}}\n"


def limbs() -> str:
    arms = ""
    for side, sign in (("Left", 1), ("Right", -1)):
        hand = joint(f"{side}Hand", (26 * sign, 0, 0), end((8 * sign, 0, 0)))
        arms += joint(f"{side}Arm", (18 * sign, 35, 0), joint(f"{side}ForeArm", (28 * sign, 0, 0), hand))
    return arms


def leg(side: str, x: float) -> str:
    foot = joint(f"{side}Foot", (0, -42, 0), end((0, -8, 12)))
    return joint(f"{side}UpLeg", (x, -4, 0), joint(f"{side}Leg", (0, -42, 0), foot))


def frame(k: int) -> str:
    values = np.zeros(6 + 3 * 15)
    values[1] = 96.0
    order = ["Spine", "Neck", "Head", "LeftArm", "LeftForeArm", "LeftHand", "RightArm"]
    values[6 + 3 * order.index("LeftArm")] = -60 + 40 * np.sin(0.3 * k)
    values[6 + 3 * order.index("RightArm")] = 60
    return " ".join(f"{v:.3f}" for v in values)


def test_motion(folder: Path, names: dict[str, Any]) -> None:
    bvh(folder / "clip.bvh")
    found = run("Motion", names)
    assert len(found["run"].frame_times) == 2
    assert np.ptp(found["person"].vertices(0.0)[:, 2]) > 1.4
    assert found["kick"].duration > 0


def test_joints(folder: Path, names: dict[str, Any]) -> None:
    """Joints of a real clip, named as a Kinect's."""
    library = MotionLibrary()
    places = body_joints(library.motion(library.actions["squat"][0].name))
    arms = [f"{side}_{part}" for side in ("left", "right") for part in ("shoulder", "elbow", "wrist", "wrist")]
    legs = [f"{side}_{part}" for side in ("left", "right") for part in ("hip", "knee", "ankle", "foot")]
    hands = ["left_wrist", "left_wrist", "right_wrist", "right_wrist"]
    parts = ["pelvis", "spine2", "neck", "head", *arms, *legs, "spine3", *hands]
    kinect = places[:, [JOINT[name] for name in parts]]
    kinect += np.random.default_rng(0).normal(0, 0.004, kinect.shape)
    np.save("joints.npy", kinect[..., [1, 2, 0]])
    run("Joints", names)


def test_mesh(folder: Path, names: dict[str, Any]) -> None:
    (folder / "chair.obj").write_text(
        "v 0 0 0\nv 400 0 0\nv 400 0 400\nv 0 0 400\nv 0 450 0\nv 400 450 0\nv 400 450 400\nv 0 450 400\n"
        "usemtl frame\nf 1 2 6 5\nf 3 4 8 7\nusemtl seat\nf 5 6 7 8\n"
    )
    box = trimesh.creation.box((1.8, 1.5, 4.0))
    box.apply_translation((0, 0.75, 0))
    box.export("car.glb")
    found = run("Mesh", names)
    height = found["chair"].vertices(0)[:, 2]
    assert (height.min(), height.max()) == pytest.approx((0.0, 0.45))
    assert np.ptp(found["car"].vertices(0.0)[:, 2]) == pytest.approx(1.5)


def test_scene(folder: Path, names: dict[str, Any]) -> None:
    floor = trimesh.creation.box((8, 0.1, 8))
    wall = trimesh.creation.box((0.1, 3, 8))
    wall.apply_translation((4, 1.5, 0))
    floor.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(name="Mat.001"))
    wall.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(name="glass"))
    trimesh.Scene({"floor": floor, "wall": wall}).export("room.glb")
    assert run("Scene", names)["simulator"].adc(duration=0.1).data.shape[0] == 1


def test_material(folder: Path, names: dict[str, Any]) -> None:
    trimesh.creation.cylinder(0.04, 0.25).export("bottle.ply")
    found = run("Material", names)
    assert found["warm"].name == "water"
    assert found["bottle"].vertices(0).shape[1] == 3
