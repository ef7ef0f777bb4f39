"""Point targets come out where they are and as fast as they are from all three radars; who tells two of them apart.

The targets are metal spheres of 1 cm radius: their echo comes from their front, that much nearer than their centre.
A cell of direction is what the virtual aperture resolves, lambda / D in the sine of the angle.
"""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from rfgen_sionna.processing import find_directions, point_cloud, range_azimuth, range_doppler
from rfgen_sionna.processing.spectrum import observation_time
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.simulation import Simulator

RADIUS = 0.01
MESH = trimesh.creation.icosphere(subdivisions=2, radius=RADIUS)
POSE = {"position": (1.0, -2.0, 1.0), "look_at": (1.0, 3.0, 0.6)}


def direction(azimuth_deg, elevation_deg=0.0):
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    return np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])


def ball(radar, range_, towards, velocity, name="ball"):
    """A sphere whose front is `range_` [m] away in device direction `towards` in the middle of the frame."""
    world = radar.rotation @ towards
    position = np.asarray(radar.position) + (range_ + RADIUS - velocity * observation_time(radar)) * world
    return MeshActor.from_mesh(MESH, material="pec", position=position, velocity=velocity * world, name=name)


def frame(radar, *actors):
    return Simulator(None, radar, actors, rtol=1e-3).adc(radar.waveform.frame_length, noise=False).data[0]


def cells(radar):
    """Resolution cells in the sine of azimuth and of elevation: wavelength over the array and one pitch more."""
    half = radar.wavelength / 2
    extent = np.ptp(radar.virtual_positions.reshape(-1, 3), axis=0)
    return radar.wavelength / (extent[1] + half), radar.wavelength / (extent[2] + half)


# radar: training cells that fit its maps, and targets: range [m], azimuth and elevation [deg], speed [m/s, receding].
RADARS = {
    "awr1843": ((8, 8), [(2.0, 0, 0, 0.4), (5.5, -25, 6, -3.0), (8.0, 12, -8, 2.1)]),
    "mmwcas": ((8, 8), [(4.0, 0, 0, 0.7), (12.0, -25, 6, -3.0), (30.0, 12, -8, 4.3)]),
    "position2go": ((6, 2), [(4.0, 0, 0, 2.0), (9.0, -25, 0, -3.7), (20.0, 12, 0, 5.0)]),
    "position2go_v11": ((6, 2), [(6.0, 17, 0, -2.6)]),
}


@pytest.mark.parametrize(
    "name", [pytest.param(each, marks=[pytest.mark.slow] * (each == "position2go_v11")) for each in RADARS]
)
def test_point_targets_are_where_they_are(name):
    """Range, velocity, azimuth, and elevation where the array has height, within a tenth of a cell."""
    radar = Radar.load(name, **POSE)
    train, targets = RADARS[name]
    azimuth_cell, elevation_cell = cells(radar)
    for range_, azimuth, elevation, velocity in targets:
        towards = direction(azimuth, elevation)
        found = point_cloud(
            frame(radar, ball(radar, range_, towards, velocity)), radar, max_points=1, guard=(1, 1), train=train
        )
        assert abs(found.range[0] - range_) < 0.1 * radar.range_resolution
        assert abs(found.velocity[0] - velocity) < 0.1 * radar.velocity_resolution
        visible = direction(np.degrees(found.azimuth[0]), np.degrees(found.elevation[0]))
        assert abs(visible[1] - towards[1]) < 0.1 * azimuth_cell
        if name.startswith("position2go"):
            assert found.elevation[0] == 0.0  # two elements side by side
        else:
            assert abs(visible[2] - towards[2]) < 0.1 * elevation_cell


@pytest.mark.parametrize("name", ["awr1843", "mmwcas"])
def test_tdm_phase(name):
    """At 5 m/s a target is where it is only after its Doppler phase has been taken out of the slots.

    5 m/s is beyond the unambiguous speed of both (4.39 and 4.95 m/s), so that the Doppler spectrum shows it folded. The
    folded speed takes out the wrong phase; the array tells which multiple fits.
    """
    radar = Radar.load(name, **POSE)
    range_, velocity, towards = 7.0, 5.0, direction(10.0)
    assert radar.max_velocity < velocity < 2 * radar.max_velocity
    cube = frame(radar, ball(radar, range_, towards, velocity))

    def misses(found):
        """By how many cells, azimuth and elevation together."""
        visible = direction(np.degrees(found.azimuth[0]), np.degrees(found.elevation[0]))
        return np.hypot(*((visible - towards)[1:] / cells(radar)))

    second_order = point_cloud(cube, radar, max_points=1)
    assert second_order.velocity[0] == pytest.approx(
        velocity - 2 * radar.max_velocity, abs=0.1 * radar.velocity_resolution
    )
    assert misses(second_order) > 0.5

    maps = range_doppler(cube, radar, velocity_bins=2 * radar.waveform.num_loops, correct_migration=True)
    r, v = np.unravel_index(maps.power.argmax(), maps.power.shape)
    channels = maps.spectrum[v, :, :, r][None]
    distance = np.array([range_])
    assert misses(find_directions(channels, radar, 0.0, distance=distance)) > 0.3
    compensated = find_directions(channels, radar, velocity, distance=distance)
    assert misses(compensated) < 0.1
    # And all channels add up, but for the element pattern's and the spreading's slight differences.
    assert compensated.power[0] == pytest.approx(np.mean(np.abs(channels) ** 2), rel=0.01)

    unfolded = point_cloud(cube, radar, max_points=1, ambiguities=1)
    assert unfolded.velocity[0] == pytest.approx(velocity, abs=0.1 * radar.velocity_resolution)
    assert unfolded.range[0] == pytest.approx(range_, abs=0.1 * radar.range_resolution)
    assert misses(unfolded) < 0.1


def peaks(radar, cube, distance, span=12.0):
    """Azimuths [deg] of the beams' maxima in the range cell, those within 6 dB of the strongest."""
    azimuth = np.radians(np.linspace(-span, span, 481))
    found = range_azimuth(cube, radar, azimuth=azimuth, array_window="none")
    level = 10 * np.log10(found.power[np.abs(found.range - distance).argmin()])
    inner = (level[1:-1] > level[:-2]) & (level[1:-1] >= level[2:]) & (level[1:-1] > level.max() - 6)
    return np.degrees(azimuth[1:-1][inner])


@pytest.mark.parametrize("quarter", [0, 2, *(pytest.param(each, marks=pytest.mark.slow) for each in (1, 3))])
def test_only_the_cascade_tells_two_targets_apart(quarter):
    """2.5 degrees apart at 8 m: a peak at each from the cascade (1.3 degrees a cell), not from the AWR1843 (14).

    That must not hang on how the two echoes add: one target moves back by quarters of the two-way wavelength. In
    antiphase the AWR1843 has two peaks too, nine degrees off to either side, where nothing is.
    """
    apart, range_, velocity = 2.5, 8.0, 1.0
    for name, resolved in (("mmwcas", True), ("awr1843", False)):
        radar = Radar.load(name, **POSE)
        step = quarter * radar.wavelength / 8
        pair = [
            ball(radar, range_, direction(-apart / 2), velocity, "right"),
            ball(radar, range_ + step, direction(apart / 2), velocity, "left"),
        ]
        visible = peaks(radar, frame(radar, *pair), range_)
        true = [-apart / 2, apart / 2]
        assert (len(visible) == 2 and np.allclose(visible, true, atol=0.35)) == resolved
        if not resolved:
            assert not any(np.abs(visible - angle).min() < 0.35 for angle in true)
