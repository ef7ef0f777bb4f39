"""Point targets come out where they are, and as fast as they are, whatever the Tx elements and the chirps do.

As in `test_three_radars`: metal spheres of 1 cm radius, whose echo comes from their front; a cell of direction is what
the virtual aperture resolves, lambda / D in the sine of the angle.
"""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from rfgen_sionna.processing import (
    compensate_tdm,
    demultiplex,
    find_directions,
    micro_doppler,
    point_cloud,
    range_doppler,
    select_profile,
    select_slot,
)
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


def frame(radar, *targets):
    """(chirp, tx, rx, sample) of spheres: range [m] and velocity [m/s] in the frame's middle, azimuth, elevation."""
    middle = radar.of_profile(0)
    balls = []
    for index, (range_, azimuth, elevation, velocity) in enumerate(targets):
        world = radar.rotation @ direction(azimuth, elevation)
        position = np.asarray(radar.position) + (range_ + RADIUS - velocity * observation_time(middle)) * world
        balls.append(
            MeshActor.from_mesh(MESH, material="pec", position=position, velocity=velocity * world, name=str(index))
        )
    return Simulator(None, radar, balls, rtol=1e-3).adc(radar.waveform.frame_length, noise=False).data[0]


def cells(radar):
    half = radar.wavelength / 2
    extent = np.ptp(radar.virtual_positions.reshape(-1, 3), axis=0)
    return radar.wavelength / (extent[1] + half), radar.wavelength / (extent[2] + half)


def check(found, radar, target, *, elevation=False, columns=None):
    """One target within a tenth of a cell of range, velocity and direction."""
    range_, azimuth, height, velocity = target
    assert len(found.range) >= 1
    assert abs(found.range[0] - range_) < 0.1 * radar.range_resolution
    assert abs(found.velocity[0] - velocity) < 0.1 * radar.velocity_resolution
    visible = direction(np.degrees(found.azimuth[0]), np.degrees(found.elevation[0]))
    towards = direction(azimuth, height)
    cell = cells(radar)
    assert abs(visible[1] - towards[1]) < 0.1 * (cell[0] if columns is None else columns)
    if elevation:
        assert abs(visible[2] - towards[2]) < 0.1 * cell[1]


# preset, whether the array has height, targets: range [m], azimuth and elevation [deg], radial velocity [m/s].
ONE_PROFILE = [
    ("bpm", False, [(2.0, 0, 0, 0.4), (5.5, -25, 0, -5.0)]),
    ("ddm", True, [(2.0, 0, 0, 0.0), (8.0, 12, -8, 2.1)]),
]


@pytest.mark.parametrize(("preset", "height", "targets"), ONE_PROFILE)
def test_elements_that_share_slots(preset, height, targets):
    radar = Radar.load("awr1843", preset, **POSE)
    for target in targets:
        cube = frame(radar, target)
        check(point_cloud(cube, radar, max_points=1, static=True), radar, target, elevation=height)


@pytest.mark.parametrize("preset", ["bpm", "ddm"])
def test_told_apart_they_are_a_radar_like_any_other(preset):
    """The cube of :func:`demultiplex` gives range, velocity and direction in plain FFTs over its axes."""
    target = (5.5, -25.0, 0.0, 1.9)
    radar = Radar.load("awr1843", preset, **POSE)
    cube, apart = demultiplex(frame(radar, target), radar)
    assert cube.shape == apart.frame_shape
    assert apart.frame_shape[1:] == (len(radar.tx_names), 4, 256)
    assert apart.max_velocity == pytest.approx(radar.max_velocity)
    assert apart.velocity_resolution == pytest.approx(radar.velocity_resolution)
    check(point_cloud(cube, apart, max_points=1, static=True), apart, target)
    maps = range_doppler(cube, apart)
    level = np.abs(maps.spectrum)
    peaks = level.max(axis=(0, 3))
    np.testing.assert_allclose(peaks / peaks.mean(), 1.0, atol=0.02)  # every element hears the target alike


def test_without_the_code_directions_are_wrong():
    """At 5 m/s the two slots of a loop differ by 1.2 rad: a code that is inverted without that mixes the elements."""
    radar = Radar.load("awr1843", "bpm", **POSE)
    target = (5.5, -25.0, 0.0, -5.0)
    cube = frame(radar, target)
    maps = range_doppler(cube, radar)
    r, v = np.unravel_index(maps.power.argmax(), maps.power.shape)
    channels = maps.spectrum[v, :, :, r][None]
    right = find_directions(channels, radar, maps.velocity[v : v + 1], distance=[5.5])
    wrong = find_directions(channels, radar, [0.0], distance=[5.5])
    assert abs(np.sin(right.azimuth[0]) - direction(-25)[1]) < 0.1 * cells(radar)[0]
    # All of the power is in one direction when decoded rightly.
    decoded = compensate_tdm(channels, radar, maps.velocity[v : v + 1])
    assert right.power[0] == pytest.approx(np.mean(np.abs(decoded) ** 2), rel=0.01)
    assert wrong.power[0] < 0.9 * right.power[0]


def test_a_code_unfolds_speeds():
    """9 m/s folds at 6.6: the wrong multiple mixes the two elements, the right one gives range, speed and direction."""
    radar = Radar.load("awr1843", "bpm", **POSE)
    target = (7.0, 12.0, 0.0, 9.0)
    assert radar.max_velocity < target[3] < 2 * radar.max_velocity
    found = point_cloud(frame(radar, target), radar, max_points=1, ambiguities=1)
    check(found, radar, target)


@pytest.mark.parametrize("preset", ["near_far", "triangle"])
@pytest.mark.parametrize("profile", [0, 1])
def test_each_profile_by_itself(preset, profile):
    radar = Radar.load("awr1843", preset, **POSE)
    target = (6.5, 17.0, 0.0, 1.4)
    whole = frame(radar, target)
    cube, chosen = select_profile(whole, radar, profile)
    # The instant that range refers to is that of the profile's own chirps.
    shift = target[3] * (observation_time(chosen) - observation_time(radar.of_profile(0)))
    moved = (target[0] + shift, *target[1:])
    check(point_cloud(cube, chosen, max_points=1, static=True), chosen, moved)
    with pytest.raises(ValueError, match=r"has 2 profiles.*select_profile"):
        range_doppler(whole, radar)


def test_a_triangle_tells_range_from_doppler():
    """Up, a receding target beats higher by its Doppler frequency, down lower: v f_c / mu to either side in range."""
    radar = Radar.load("awr1843", "triangle", **POSE)
    velocity = 2.0
    cube = frame(radar, (6.5, 0.0, 0.0, velocity))
    visible = []
    for profile in (0, 1):
        samples, chosen = select_profile(cube, radar, profile)
        maps = range_doppler(samples, chosen, range_bins=64 * 256)
        visible.append(maps.range[maps.power.max(axis=1).argmax()])
        shift = velocity * (observation_time(chosen) - observation_time(radar.of_profile(0)))
        visible[-1] -= shift
    expected = 2 * velocity * radar.center_frequency / 60.012e12
    assert visible[0] - visible[1] == pytest.approx(expected, abs=0.1 * radar.range_resolution / 2)
    assert np.mean(visible) == pytest.approx(6.5, abs=0.1 * radar.range_resolution)


def test_a_beam_looks_where_its_phases_point():
    """Rx elements give range, velocity and azimuth; the level follows the array factor of the nine Tx elements."""
    radar = Radar.load("mmwcas", "steered_left", **POSE)
    half = radar.wavelength / 2
    extent = np.ptp(radar.rx_positions[:, 1])
    target = (12.0, np.degrees(np.arcsin(0.125)), 0.0, 1.1)
    cube = frame(radar, target)
    found = point_cloud(cube, radar, max_points=1, static=True)
    check(found, radar, target, columns=radar.wavelength / (extent + half))

    single, _ = select_slot(cube, radar, 0)
    powers = {}
    for sine in (0.125, 0.0625, 0.0):
        other = frame(radar, (12.0, np.degrees(np.arcsin(sine)), 0.0, 1.1))
        powers[sine] = np.mean(np.abs(other) ** 2)
        k = 2 * np.pi / radar.wavelength
        phases = np.radians(list(radar.waveform.slots[0].phases_deg))
        factor = np.abs(np.exp(1j * (k * radar.tx_positions[:, 1] * sine + phases)).sum()) ** 2
        gain = 10 ** (2 * radar.pattern.gain_db(direction(np.degrees(np.arcsin(sine)))) / 10)
        powers[sine] /= gain
        if sine == 0.125:
            assert factor == pytest.approx(81.0, rel=0.02)
            reference = powers[sine] / factor
        elif factor > 1:
            assert powers[sine] == pytest.approx(reference * factor, rel=0.05)
        else:
            assert powers[sine] < 0.02 * powers[0.125]
    assert single.shape == radar.frame_shape


@pytest.mark.parametrize("velocity", [pytest.param(3.3, marks=pytest.mark.slow), -7.1])
def test_a_constant_frequency_tells_speeds_alone(velocity):
    """One range bin; speed within a tenth of a cell, azimuth of the two elements too; no points."""
    radar = Radar.load("position2go", "doppler", **POSE)
    cube = frame(radar, (6.0, 17.0, 0.0, velocity))
    bins = 16 * radar.waveform.num_loops
    maps = range_doppler(cube, radar, velocity_bins=bins)
    assert maps.range.tolist() == [0.0]
    peak = maps.power[0].argmax()
    assert abs(maps.velocity[peak] - velocity) < 0.1 * radar.velocity_resolution
    found = find_directions(maps.spectrum[peak, :, :, 0][None], radar, maps.velocity[[peak]])
    assert abs(np.sin(found.azimuth[0]) - direction(17)[1]) < 0.1 * cells(radar)[0]
    with pytest.raises(ValueError, match="points have no ranges"):
        point_cloud(cube, radar)
    spectrogram = micro_doppler(cube[None], radar, static=True)
    assert abs(spectrogram.velocity[spectrogram.power.sum(axis=0).argmax()] - velocity) < 2 * radar.velocity_resolution


def test_two_targets_in_doppler_bands_stay_two():
    """Echoes of one target by the three Tx lie in three bands; the map of each element shows two targets only."""
    radar = Radar.load("awr1843", "ddm", **POSE)
    targets = [(3.0, 10, 0, -2.0), (6.0, -15, 0, 1.5)]
    found = point_cloud(frame(radar, *targets), radar, static=True, dynamic_range_db=25)
    nearest = [min(targets, key=lambda target: abs(target[0] - range_)) for range_ in found.range]
    for target, range_, velocity in zip(nearest, found.range, found.velocity, strict=True):
        assert abs(range_ - target[0]) < radar.range_resolution
        assert abs(velocity - target[3]) < radar.velocity_resolution
    assert {target[0] for target in nearest} == {3.0, 6.0}
