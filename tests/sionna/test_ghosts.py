"""Ghosts of our tracer against those that Sionna finds for a sensing target over a floor."""

import numpy as np
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor, add_radar, load_scene
from rfgen_sionna.simulation import Simulator
from tests.sionna.rectangles import add_rectangles, scene_of


def test_a_ball_over_a_concrete_floor_has_sionna_s_ghosts():
    """Number, delay, level and Doppler of the direct return, of those by the floor once, and twice."""
    import sionna.rt.rcs

    radar = Radar.load("awr1843", position=(0, 0, 1.0), overrides={"pattern": {"kind": "sionna:iso"}})
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=0.02)
    actor = MeshActor.from_mesh(mesh, material="metal", position=(4, 0, 0.6), velocity=(0.5, 0.0, -1.5), name="ball")
    scene = scene_of(radar.center_frequency)
    floor = [[-0.5, -0.8, 0], [5, -0.8, 0], [5, 0.8, 0], [-0.5, 0.8, 0]]
    add_rectangles(scene, floor=(floor, "concrete", 0.2))
    ours = Simulator(load_scene(scene.sionna), radar, [actor], rtol=1e-2, max_bounces=None).paths()
    ours = ours.select(ours.object_id == ours.object_names.index("ball"))
    add_radar(scene, radar)
    rfgen.add_actor(scene, actor)
    solver = sionna.rt.rcs.RCSSolver()
    settings = {"samples_per_sp": 20_000, "synthetic_array": False, "seed": 1, "refraction": False}
    theirs = rfgen.from_sionna(solver(scene.sionna, max_depth=3, **settings), radar, scene=scene)
    assert sorted(theirs.bounces.tolist()) == [1, 2, 2, 3]

    def down(paths):
        """Whether the first and the last leg go below the ball, to where its image is."""
        return [each[:, 0, 2] < -0.25 for each in (paths.direction, paths.arrival)]

    for first in (False, True):
        for last in (False, True):
            mine, its = (each.select((down(each)[0] == first) & (down(each)[1] == last)) for each in (ours, theirs))
            assert set(mine.bounces) == set(its.bounces) == {1 + first + last}
            sums = [
                (p.a * np.exp(-2j * np.pi * np.mod(p.frequency * p.tau, 1.0)))[..., 0].sum(axis=-1) for p in (mine, its)
            ]
            assert abs(20 * np.log10(abs(sums[0] / sums[1]))).max() < 0.5
            power = np.abs(mine.a[..., 0]) ** 2
            rate = (power * mine.tau_rate[..., 0]).sum(axis=-1) / power.sum(axis=-1)
            np.testing.assert_allclose(rate, its.tau_rate[..., 0, 0], rtol=0, atol=0.02 / 3e8)
            # Facets lie before the centre, which Sionna's delay is for, by up to the radius on both legs.
            ahead = its.tau[..., 0] - mine.tau[..., 0].min(axis=-1, keepdims=True)
            assert ahead.min() > 0
            assert ahead.max() < 2 * 0.021 / 3e8
