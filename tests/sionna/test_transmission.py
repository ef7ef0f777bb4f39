"""What is seen through slabs against Sionna's refracted paths."""

import numpy as np
import pytest

import rfgen_sionna as rfgen
from rfgen_sionna.records import SPEED_OF_LIGHT
from rfgen_sionna.scene import add_radar, load_scene
from rfgen_sionna.scene.backend import ensure_backend
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.slabs import transmission
from tests.sionna.rectangles import add_rectangles, apart, scene_of, wall


@pytest.mark.parametrize(("name", "thickness"), [("glass", 0.006), ("plasterboard", 0.0125)])
def test_a_mirror_behind_a_slab_is_as_sionna_refracts(name, thickness):
    """Complex ratio of the mirror's return behind a slab to that without, for every element pair, within 7 %: of the
    mirror's rim, where other angles meet the slab, a wave of up to 5 % is left that ray optics does not have."""
    import sionna.rt

    radar = apart(baseline=0.1, position=(0.0, 0.0, 1.0), overrides={"pattern": {"kind": "sionna:iso"}})
    ours, theirs = [], []
    for slabs in ({}, {"slab": (wall(1.5, half=0.6), name, thickness)}):
        scene = scene_of(radar.center_frequency, mirror=(wall(2.5, half=0.7), "metal", 0.01))
        add_rectangles(scene, **slabs)
        add_radar(scene, radar)
        settings = {"los": False, "refraction": True, "samples_per_src": 50_000, "synthetic_array": False}
        found = rfgen.from_sionna(sionna.rt.PathSolver()(scene.sionna, max_depth=3, **settings), radar)
        mine = Simulator(load_scene(scene.sionna), radar, [], rtol=1e-2, transmission=True).paths()
        for paths, sums in ((mine, ours), (found, theirs)):
            # By depth: the mirror's own return, straight through the slab, no to and fro between the two.
            far = paths.select((paths.range[:, 0] > 2.3) & (paths.range[:, 0] < 2.7))
            phase = np.mod(far.frequency * far.tau[..., 0], 1.0)
            gains = far.a[..., 0]
            sums.append((gains * np.exp(-2j * np.pi * phase)).sum(axis=-1))
    np.testing.assert_allclose(ours[1] / ours[0], theirs[1] / theirs[0], rtol=0.07)


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
