"""A small metal sphere comes out where it is, as fast as it is, and as strong as the radar equation says."""

import numpy as np
import pytest
import trimesh

from rfgen_sionna.processing import point_cloud
from rfgen_sionna.processing.spectrum import observation_time
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.simulation import Simulator

RADIUS = 0.01


def direction(azimuth_deg, elevation_deg):
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    return np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])


# range [m], azimuth and elevation [deg, + left, + up], radial velocity [m/s, + receding]
TARGETS = [
    (2.0, 0, 0, 0.4),
    (3.0, 25, 0, -1.3),
    (4.0, -30, 6, 2.1),
    (5.5, 10, -10, -3.0),
    (8.0, -12, 3, 0.9),
    (1.2, 40, 8, -0.6),
]


@pytest.mark.parametrize(
    ("preset", "targets"),
    [
        ("mmmesh", TARGETS[1:5:3]),
        ("di_gesture", [(1.5, 15, 0, -0.5)]),
        pytest.param("mmmesh", TARGETS, marks=pytest.mark.slow),
    ],
)
def test_sphere_is_where_it_is(preset, targets):
    """Range, velocity, azimuth and elevation within a tenth of a cell, signs and sides included; level within 0.5 dB.

    One cell of direction is what the virtual aperture resolves, lambda / D: 8 half wavelengths across for azimuth
    and one, a quarter of the sine's range, for elevation.
    """
    radar = Radar.load("awr1843", preset, position=(1.0, -2.0, 1.0), look_at=(1.0, 3.0, 0.6))
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=RADIUS)
    for range_, azimuth, elevation, velocity in targets:
        towards = direction(azimuth, elevation)
        world = radar.rotation @ towards
        middle = observation_time(radar)
        position = np.asarray(radar.position) + (range_ - velocity * middle) * world
        ball = MeshActor.from_mesh(mesh, material="pec", position=position, velocity=velocity * world, name="ball")
        cube = Simulator(None, radar, [ball], rtol=1e-3).adc(radar.waveform.frame_length, noise=False).data[0]
        found = point_cloud(cube, radar, max_points=1)
        assert len(found.range) == 1
        # The echo comes from the front of the sphere.
        assert abs(found.range[0] - (range_ - RADIUS)) < 0.1 * radar.range_resolution
        assert abs(found.velocity[0] - velocity) < 0.1 * radar.velocity_resolution
        got = np.array([np.cos(found.elevation[0]) * np.sin(found.azimuth[0]), np.sin(found.elevation[0])])
        assert abs(got[0] - towards[1]) < 0.1 * (2 / 8)
        if preset == "mmmesh":  # the two Tx elements of the other preset stand in one row
            assert abs(got[1] - towards[2]) < 0.1 * (2 / 2)

        gain = 2 * radar.pattern.gain_db(towards)
        sigma = np.pi * RADIUS**2
        expected = (
            radar.tx_power_dbm
            - 30
            + gain
            + 10 * np.log10(radar.wavelength**2 * sigma / ((4 * np.pi) ** 3 * (range_ * (range_ - RADIUS)) ** 2))
        )
        assert 10 * np.log10(np.mean(np.abs(cube) ** 2)) == pytest.approx(expected, abs=0.5)
