"""What the antennas make of a facet's points changes over it: each of them counts by its own direction."""

import numpy as np
import pytest
import trimesh

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import SPEED_OF_LIGHT
from rfgen_sionna.scene import Actor
from rfgen_sionna.scene.mesh import columns
from rfgen_sionna.tracing.smooth import smoothing
from rfgen_sionna.tracing.tracer import Tracer
from tests.reference.physical_optics import patches, triangle_points


def weighted(paths, radar):
    """Sum over paths of the first pair in the middle of the band, antennas included."""
    turns = np.mod(paths.frequency * paths.tau[0, 0, :, 0], 1.0)
    gain = radar.pattern.gain_db(paths.direction[:, 0] @ radar.rotation) - radar.pattern.peak_gain_dbi
    return complex((10 ** (gain / 10) * paths.a[0, 0, :, 0] * np.exp(-2j * np.pi * turns)).sum())


def dense(vertices, faces, radar, points):
    """The quadratic patches that a mesh's faces stand for, of a perfect conductor, point by point."""
    tx, rx = radar.tx_world[0], radar.rx_world[0]
    k = 2 * np.pi * radar.center_frequency / SPEED_OF_LIGHT
    smooth, total = smoothing(vertices, faces), 0.0
    rises = np.zeros((len(faces), 3, 3)) if smooth is None else smooth.bend(columns(vertices, faces)).rises
    for corner, rise in zip(vertices[faces], rises, strict=True):
        point, cross = (each[0] for each in patches(corner[None], rise[None], points))
        _, weight = triangle_points(corner[None], points)
        to_tx, to_rx = (np.linalg.norm(point - each, axis=1) for each in (tx, rx))
        offset = point - radar.position
        direction = offset / np.linalg.norm(offset, axis=1)[:, None]
        facing = np.maximum(-np.einsum("qi,qi->q", direction, cross), 0.0)
        gain = radar.pattern.gain_db(direction @ radar.rotation) - radar.pattern.peak_gain_dbi
        wave = np.exp(-1j * k * (to_tx + to_rx)) / (to_tx * to_rx)
        total += (10 ** (gain / 10) * facing * weight * wave).sum() / (8j * np.pi)
    return total


@pytest.mark.parametrize("rtol", [1e-2, 1e-3])
@pytest.mark.parametrize("place", [(0.9, 0.5, 0.3), (1.2, -0.9, 0.0), (0.7, 0.0, 0.35)])
def test_each_point_of_a_ball_counts_by_its_own_direction(place, rtol):
    """A coarse ball beside and above the beam, where the pattern falls steeply over it: to the tolerance, or to the
    0.3 % that the reference's sums along the ball's rim are good for. By the directions of its facets' middles
    alone it errs by 0.4 to 8 %."""
    radar = Radar.load("awr1843", position=(0, 0, 0), look_at=(3, 0, 0))
    ball = Actor.from_mesh(trimesh.creation.icosphere(2, 0.2), material="pec", position=place, name="ball")
    found = weighted(Tracer(None, radar, [ball], rtol).instant(0.0), radar)
    truth = dense(ball.vertices(0.0), ball.faces, radar, 60)
    assert abs(found - truth) < max(0.6 * rtol, 3e-3) * abs(truth)
