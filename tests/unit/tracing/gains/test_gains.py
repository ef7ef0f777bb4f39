"""Gains of facets in parts, delay rates, and media at the nodes."""

import numpy as np
import pytest

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import material as material_named
from rfgen_sionna.tracing.gains import band as gains
from rfgen_sionna.tracing.integral.facet import Nodes, facet_gains, split_by_curvature
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.surface.quadratic_patch import QuadraticPatch


@pytest.mark.parametrize("runs", [1, 2, 7, 400])
def test_flat_and_curved_facets_come_back_in_their_order(runs: int):
    """Gains of flat and curved facets are those of single facets."""
    rng = np.random.default_rng(runs)
    curved = np.repeat(np.arange(runs) % 2 == 1, rng.integers(1, 9, runs))
    corners = np.array([3.0, 0, 0]) + 0.01 * rng.normal(size=(len(curved), 3, 3))
    material, parts = np.zeros(len(curved), np.int32), rng.integers(1, 4, len(curved)).astype(np.int32)
    nodes = Nodes(np.zeros((2, 3)), np.zeros((2, 3)), np.array([76e9, 78e9]))
    media = Media.at([material_named("metal")], nodes.frequency, 1e9)
    patch, asked = QuadraticPatch(1e-3 * rng.normal(size=(len(curved), 3, 3)) * curved[:, None, None]), []

    def of(index, bent, buffer):
        asked.append(bent)
        return facet_gains(
            corners[index], material[index], media, nodes, np.array([0, 0, 1.0]), np.array([0, 0, 1.0]), parts[index],
            patch=patch.take(index) if bent else None, buffer=buffer,
        )  # fmt: skip

    found = split_by_curvature(curved, of)
    assert asked == ([False] if runs == 1 else [False, True])
    for k in rng.permutation(len(curved))[:20]:
        alone = of(slice(k, k + 1), bool(curved[k]), None)
        np.testing.assert_allclose(found.a[:, k], alone.a[:, 0], rtol=1e-12)
        np.testing.assert_allclose(found.tau[:, k], alone.tau[:, 0], rtol=1e-14)


def test_rates_are_those_of_delays():
    """Rates of points in straight motion against differences of delays."""
    radar = Radar.load("awr1843", "mmmesh", position=(0.3, -0.2, 1), look_at=(3, 0, 1))
    band, rng = gains.BandTracer(radar, 1e-2), np.random.default_rng(0)
    places, velocities = rng.uniform(-1, 1, (40, 3)) + np.array([3, 0, 1]), rng.uniform(-5, 5, (40, 3))
    step = 1e-5
    before, after = (band.delays(places + sign * step * velocities) for sign in (-1, 1))
    found = band.rates(places, velocities)
    assert found.shape == (3, 4, 40)
    np.testing.assert_allclose(found, (after - before) / (2 * step), rtol=0, atol=1e-5 / SPEED_OF_LIGHT)
    assert np.abs(found).max() > 1.0 / SPEED_OF_LIGHT


def test_media_at_the_end_of_a_material_s_frequency_range():
    """One thickness per material for any number of nodes, and no permittivity beyond the band."""
    materials = [material_named(name, outside="raise") for name in ("skin", "glass", "plasterboard")]
    media = Media.at(materials, np.array([96e9, 98e9, 100e9]), 2e9)
    assert media.thickness.shape == media.smoothness.shape == (3,)
    assert media.permittivity.shape == media.permeability.shape == media.raised.shape == (3, 3)
    rise = (media.raised - media.permittivity) / (media.permittivity[1:] - media.permittivity[:-1])[[0, 1, 1]]
    skin = rise[:, 0] * 2e9 / (1e-4 * np.array([96e9, 98e9, 100e9]))  # the slope over that from node to node
    assert np.abs(skin - 1).max() < 0.05
