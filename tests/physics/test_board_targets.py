"""A ball is where it is and as fast as it is for each board: from its own file, and from its maker's configuration.

The ball is a metal sphere of 1 cm radius: its echo comes from its front, that much nearer than its centre. A cell of
direction is what the virtual aperture resolves, lambda / D in the sine of the angle.
"""

from __future__ import annotations

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
    return Simulator(None, radar, [ball]).adc(radar.waveform.frame_length, noise=False).data[0]


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


SLOW = ("awr2944evm", "ddm")


@pytest.mark.parametrize(
    ("name", "preset"), [pytest.param(*key, marks=[pytest.mark.slow] * (key == SLOW)) for key in TARGETS]
)
def test_a_ball_is_found_where_it_is(name, preset):
    few = {"preset.out_of_box.num_loops": 8} if preset == "out_of_box" else None
    check_found(Radar.load(name, preset, overrides=few, **POSE), *TARGETS[name, preset])


@pytest.mark.parametrize(("name", "sign"), [("iwr6843isk_ods", [1, -1, -1, 1]), ("iwr6843aop", [1, -1, 1, -1])])
def test_feeds_from_the_other_side_turn_raw_samples(name, sign):
    """Ahead of the board all 12 channels have one phase, but for the sign of two receivers."""
    radar = Radar.load(name, overrides={"preset.out_of_box.num_loops": 2})
    cube = frame(radar, (8.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    channels = np.sum(cube * cube[:, :1, :1].conj(), axis=(0, 3))
    np.testing.assert_allclose(np.angle(channels * np.array(sign)), 0.0, atol=np.radians(3))
