"""Pattern gains and gradients by the kernel against the pattern itself."""

import numpy as np
import pytest

from rfgen_sionna.radar import ElementPattern, Radar, TablePattern
from rfgen_sionna.tracing.gains.element_pattern import PatternGain


def turned(seed):
    """A rotation, and unit vectors all around, poles and back included."""
    rng = np.random.default_rng(seed)
    rotation = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))
    local = rng.standard_normal((4000, 3))
    local[:6] = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (0, 0, -1)]
    return rotation, (local / np.linalg.norm(local, axis=1)[:, None]) @ rotation.T


@pytest.mark.parametrize("name", ["awr1843", "mmwcas", "position2go"])
def test_gains_are_those_of_the_radar_s_pattern(name):
    pattern = Radar.load(name).pattern
    assert isinstance(pattern, ElementPattern)
    rotation, direction = turned(0)
    beam = PatternGain(pattern, rotation)
    level = pattern.gain_db(direction @ rotation) - pattern.peak_gain_dbi
    # At the poles rounding decides about the azimuth.
    some = np.abs((direction @ rotation)[:, 2]) < 1.0 - 1e-12
    assert some.sum() == len(direction) - 2
    assert np.allclose(beam.gains(direction)[some], 10 ** (level[some] / 10), rtol=1e-9, atol=1e-15)
    assert beam.gains(direction.reshape(40, 100, 3)).shape == (40, 100)
    assert beam.gains(direction[:0]).shape == (0,)
    distance = np.linspace(0.1, 50, len(direction))[:, None]
    slope = pattern.slope_db(direction @ rotation) @ rotation.T
    pattern_gradient = beam.gradients(direction * distance)
    # At the poles and at the cuts' own angles either side's slope will do.
    near = np.abs(pattern_gradient * distance - 0.1 * np.log(10) * slope) <= 1e-9 * np.abs(slope).max()
    assert near[6:].all()


def test_gradients_are_differences_of_gains():
    rotation, direction = turned(1)
    beam = PatternGain(Radar.load("awr1843").pattern, rotation)
    # Towards the poles the slope is left small, and at the cuts' angles it bends.
    place, step = 3.0 * direction[np.abs(direction @ rotation[:, 2]) < 0.95], 1e-6

    def logarithm(at):
        return np.log(beam.gains(at / np.linalg.norm(at, axis=1)[:, None]))

    rise = [(logarithm(place + step * axis) - logarithm(place - step * axis)) / (2 * step) for axis in np.eye(3)]
    assert np.median(np.abs(np.stack(rise, axis=1) - beam.gradients(place))) < 1e-7
    assert np.quantile(np.abs(np.stack(rise, axis=1) - beam.gradients(place)), 0.99) < 1e-4


def test_an_isotropic_pattern_has_no_gradient():
    rotation, direction = turned(2)
    beam = PatternGain(ElementPattern(3.0), rotation)
    assert np.allclose(beam.gains(direction), 1.0)
    assert beam.gradients(direction) is None


def test_gains_of_a_table():
    azimuth, elevation = np.linspace(-180, 180, 73), np.linspace(-90, 90, 37)
    table = TablePattern.of(azimuth, elevation, 6.0 - 0.05 * np.abs(azimuth)[:, None] - 0.1 * np.abs(elevation))
    rotation, direction = turned(3)
    beam = PatternGain(table, rotation)
    level = table.gain_db(direction @ rotation) - table.peak_gain_dbi
    assert np.allclose(beam.gains(direction), 10 ** (level / 10), rtol=1e-12)
    slope = table.slope_db(direction @ rotation) @ rotation.T
    assert np.allclose(beam.gradients(2.0 * direction), 0.05 * np.log(10) * slope)
