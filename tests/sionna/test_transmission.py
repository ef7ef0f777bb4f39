"""What is seen through slabs against Sionna's refracted paths."""

import numpy as np
import pytest

import rfgen_sionna as rfgen
from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.scene import add_radar, load_scene
from rfgen_sionna.scene.mitsuba_backend import ensure_backend
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.integral.slabs import transmission
from tests.sionna.rectangles import add_rectangles, apart, scene_of, wall

DISTANCE = 2.5


def sides(wavelength):
    """Half the sides of four mirrors whose rims are a quarter of a wavelength further there and back, one after the
    other: what the rims return cancels in their mean, and so do the corners' waves."""
    longest = np.hypot(DISTANCE, 0.6) + np.arange(4) * wavelength / 8
    return np.sqrt(longest**2 - DISTANCE**2)


def mirror(radar, half, slabs):
    """The scene's own return, straight through the slab (no to and fro between the two), of a metal mirror of 2 `half`:
    per element pair, ours and Sionna's."""
    import sionna.rt

    scene = scene_of(radar.center_frequency, mirror=(wall(DISTANCE, half=half), "metal", 0.01))
    add_rectangles(scene, **slabs)
    add_radar(scene, radar)
    settings = {"los": False, "refraction": True, "samples_per_src": 50_000, "synthetic_array": False}
    theirs = rfgen.from_sionna(sionna.rt.PathSolver()(scene.sionna, max_depth=3, **settings), radar)
    ours = Simulator(load_scene(scene.sionna), radar, [], rtol=1e-2, transmission=True).paths()
    sums = []
    for paths in (ours, theirs):
        far = paths.select((paths.range[:, 0] > 2.3) & (paths.range[:, 0] < 2.7))
        sums.append((far.a[..., 0] * np.exp(-2j * np.pi * np.mod(far.frequency * far.tau[..., 0], 1.0))).sum(axis=-1))
    return sums


@pytest.mark.parametrize(
    ("name", "thickness"), [(None, 0.0), ("glass", 0.006), pytest.param("plasterboard", 0.0125, marks=pytest.mark.slow)]
)
def test_a_mirror_and_one_behind_a_slab_are_as_sionna_reflects_and_refracts(name, thickness):
    """Every element pair's complex return, behind a slab and without one, within 1 % (0.1 dB): a facet has the
    slab's coefficients of its middle.

    A single mirror of 1.2 m strays by up to 7 %: four rims return up to 2 % each, which ray optics does not have, and
    these meet the slab at other angles than the mirror's middle does. Over :func:`sides` they cancel.
    """
    radar = apart(baseline=0.1, position=(0.0, 0.0, 1.0), overrides={"pattern": {"kind": "sionna:iso"}})
    slabs = {} if name is None else {"slab": (wall(1.5, half=0.6), name, thickness)}
    found = [mirror(radar, half, slabs) for half in sides(radar.wavelength)]
    ours, theirs = np.mean(found, axis=0)
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=0.01 * abs(theirs).min())
    assert max(abs(one / theirs - 1).max() for one, _ in found) > 0.02


@pytest.mark.parametrize(("eps", "thickness"), [(2.7 - 0.3j, 0.0125), (6.3 - 0.2j, 0.006), (1.4 - 0.02j, 0.1)])
def test_slab_coefficients_are_sionna_s(eps, thickness):
    """Both polarisations at all angles, to the precision of single floats and their phases."""
    ensure_backend()
    import mitsuba as mi
    from sionna.rt.utils import itu_coefficients_single_layer_slab

    frequency = 77e9
    cos = np.linspace(0.05, 1, 40)
    found = itu_coefficients_single_layer_slab(
        mi.Float(cos.astype(np.float32)),
        mi.Complex2f(eps.real, eps.imag),
        mi.Float(thickness),
        mi.Float(SPEED_OF_LIGHT / frequency),
    )[2:]
    for theirs, ours in zip(found, transmission(eps, 1.0, thickness, cos, frequency), strict=True):
        both = theirs.real.numpy() + 1j * theirs.imag.numpy()
        np.testing.assert_allclose(both, ours, rtol=0, atol=3e-4 * np.abs(ours).max() * max(1.0, thickness / 0.01))
