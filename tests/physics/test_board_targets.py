"""A ball is where it is and as fast as it is for each board: from its own file, and from its maker's configuration.

The ball is a metal sphere of 1 cm radius: its echo comes from its front, that much nearer than its centre. A cell of
direction is what the virtual aperture resolves, lambda / D in the sine of the angle.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh

from rfgen_sionna.processing import point_cloud
from rfgen_sionna.processing.spectrum import observation_time
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.simulation import Simulator

RADIUS = 0.01
MESH = trimesh.creation.icosphere(subdivisions=2, radius=RADIUS)
POSE = {"position": (1.0, -2.0, 1.0), "look_at": (1.0, 3.0, 0.6)}

# board, preset: range [m], azimuth and elevation [deg], speed [m/s, receding].
TARGETS = {
    ("iwr6843isk", "out_of_box"): (2.0, 12.0, -8.0, 0.3),
    ("iwr6843isk_ods", "people_tracking"): (4.0, -25.0, 20.0, -1.3),
    ("iwr6843aop", "people_tracking"): (4.0, 25.0, -20.0, 2.2),
    ("iwr1443boost", "radhar"): (3.0, -25.0, 6.0, -2.6),
    ("awr1642boost", "out_of_box"): (4.5, 17.0, 0.0, 0.45),
    ("awr1642boost", "bpm"): (4.5, 17.0, 0.0, 1.7),
    ("awr2944evm", "out_of_box"): (5.5, 12.0, 2.0, -0.4),
    ("awr2944evm", "four_tx"): (7.0, -18.0, -2.0, 1.2),
    ("awr2944evm", "ddm"): (3.0, -18.0, -2.0, 1.2),
    ("bgt60tr13c", "range_doppler"): (2.2, 20.0, -15.0, 0.8),
    ("bgt60tr13c", "breathing"): (0.45, 20.0, -15.0, 0.9),
}


def frame(radar, position, velocity):
    """(chirp, tx, rx, sample) of the ball."""
    ball = MeshActor.from_mesh(MESH, material="pec", position=position, velocity=velocity)
    return Simulator(None, radar, [ball], rtol=1e-3).adc(radar.waveform.frame_length, noise=False).data[0]


def check_found(radar, range_, azimuth_deg, elevation_deg, velocity):
    """Range, velocity, azimuth, and elevation where the array has height, within a tenth of a cell."""
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    towards = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    world = radar.rotation @ towards
    start = np.asarray(radar.position) + (range_ + RADIUS - velocity * observation_time(radar)) * world
    cube = frame(radar, start, velocity * world)
    found = point_cloud(cube, radar, max_points=1, guard=(1, 1), train=(4, 2))
    assert abs(found.range[0] - range_) < 0.1 * radar.range_resolution
    assert abs(found.velocity[0] - velocity) < 0.1 * radar.velocity_resolution
    half = radar.wavelength / 2
    extent = np.ptp(radar.virtual_positions.reshape(-1, 3), axis=0)
    visible = np.array([np.cos(found.elevation[0]) * np.sin(found.azimuth[0]), np.sin(found.elevation[0])])
    assert abs(visible[0] - towards[1]) < 0.1 * radar.wavelength / (extent[1] + half)
    if extent[2]:
        assert abs(visible[1] - towards[2]) < 0.1 * radar.wavelength / (extent[2] + half)


SLOW = (
    ("awr1642boost", "bpm"),
    ("awr2944evm", "out_of_box"),
    ("awr2944evm", "four_tx"),
    ("awr2944evm", "ddm"),
    ("iwr6843isk", "out_of_box"),
    ("bgt60tr13c", "breathing"),
)


@pytest.mark.parametrize(
    ("name", "preset"), [pytest.param(*key, marks=[pytest.mark.slow] * (key in SLOW)) for key in TARGETS]
)
def test_a_ball_is_found_where_it_is(name, preset):
    few = {"preset.out_of_box.num_loops": 8} if preset == "out_of_box" else None
    check_found(Radar.load(name, preset, overrides=few, **POSE), *TARGETS[name, preset])


# board: arguments of profileCfg, Tx mask of each chirp, those of frameCfg, real samples; and a target.
PROFILES = {
    "iwr6843isk": ("0 60.25 30 7 50 0 0 70 1 192 5000 0 0 158", [1, 4, 2], "0 2 16 0 50 1 0", False),
    "iwr6843isk_ods": ("0 60.25 30 7 50 0 0 70 1 192 5000 0 0 158", [1, 2, 4], "0 2 16 0 50 1 0", False),
    "iwr6843aop": ("0 60.25 30 7 50 0 0 70 1 192 5000 0 0 158", [1, 2, 4], "0 2 16 0 50 1 0", False),
    "iwr1443boost": ("0 77 30 7 50 0 0 70 1 192 5000 0 0 30", [1, 4, 2], "0 2 16 0 50 1 0", False),
    "awr1642boost": ("0 77 30 7 50 0 0 70 1 192 5000 0 0 30", [1, 2], "0 1 16 0 50 1 0", False),
    "awr2944evm": ("0 77 30 7 50 0 0 70 1 384 10000 0 0 30", [1, 2, 4, 8], "0 3 16 0 384 50 1 0", True),
}


@pytest.mark.parametrize("name", PROFILES)
def test_a_ball_is_found_through_a_configuration_for_the_board(name, tmp_path):
    profile, masks, frame_, real = PROFILES[name]
    chirps = [f"chirpCfg {slot} {slot} 0 0 0 0 0 {mask}" for slot, mask in enumerate(masks)]
    lines = [
        "sensorStop",
        "flushCfg",
        "dfeDataOutputMode 1",
        f"channelCfg 15 {sum(masks)} 0",
        f"adcCfg 2 {0 if real else 1}",
        f"adcbufCfg -1 {int(real)} 1 1 1",
        f"profileCfg {profile}",
        *chirps,
        f"frameCfg {frame_}",
        "sensorStart",
    ]
    path = tmp_path / "mine.cfg"
    path.write_text("\n".join(lines) + "\n")
    radar = Radar.load(path, board=name, **POSE)
    check_found(radar, 3.0, 12.0, 0.0 if name == "awr1642boost" else -2.0, 1.1)


def test_a_ball_is_found_through_infineon_s_configuration(tmp_path):
    shape = {
        "start_frequency_Hz": 59e9,
        "end_frequency_Hz": 62e9,
        "sample_rate_Hz": 2e6,
        "num_samples_per_chirp": 128,
        "num_chirps_per_frame": 16,
        "chirp_repetition_time_s": 4e-4,
        "frame_repetition_time_s": 0.05,
        "tx_antennas": [1],
        "rx_antennas": [1, 2, 3],
        "mimo_mode": "off",
    }
    path = tmp_path / "config.json"
    path.write_text(json.dumps({"device_config": {"fmcw_single_shape": shape}}))
    check_found(Radar.load(path, **POSE), 1.4, 20.0, -15.0, 1.3)


@pytest.mark.parametrize(
    ("name", "sign"),
    [pytest.param("iwr6843isk_ods", [1, -1, -1, 1], marks=pytest.mark.slow), ("iwr6843aop", [1, -1, 1, -1])],
)
def test_feeds_from_the_other_side_turn_raw_samples(name, sign):
    """Ahead of the board all 12 channels have one phase, but for the sign of two receivers."""
    radar = Radar.load(name, overrides={"preset.out_of_box.num_loops": 2})
    cube = frame(radar, (8.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    channels = np.sum(cube * cube[:, :1, :1].conj(), axis=(0, 3))
    np.testing.assert_allclose(np.angle(channels * np.array(sign)), 0.0, atol=np.radians(3))
