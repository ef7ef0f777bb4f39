"""What a mirror's rim leaves of a facet has a phase of its own: ghosts of plates that a wall cuts, by quadrature."""

import numpy as np
import pytest
import trimesh

from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.simulation import Simulator
from tests.physics.test_ghosts import ISOTROPIC, SIDE, channel, of, side_wall, ways
from tests.reference.physical_optics import Wall, po_gain

PLACE, SIZE = np.array([2.0, 0.2, 1.0]), 0.3
METAL = complex(np.inf)


@pytest.fixture(scope="module")
def radar():
    return Radar.load("awr1843", position=(0, 0, 1), overrides=ISOTROPIC)


def plate(turn):
    """A metal plate of two triangles on each side, seen by way of the wall, `turn` [rad] off where it mirrors straight
    from the wall to the radar."""
    view, image = np.array([0, 0, 1.0]), np.array([0, 2 * SIDE, 1.0])
    towards = [(each - PLACE) / np.linalg.norm(each - PLACE) for each in (view, image)]
    normal = towards[0] + towards[1]
    yaw = np.arctan2(normal[1], normal[0]) + turn
    mesh = trimesh.creation.box((0.004, SIZE, SIZE))
    return MeshActor.from_mesh(mesh, material="pec", position=PLACE, orientation=(yaw, 0, 0), name="ball")


def kept(corners, normal, offset):
    """Triangles of what is left of others (facet, 3, 3) on the side of a plane that its `normal` points to."""
    found = []
    for triangle in corners:
        height = triangle @ normal - offset
        points = []
        for k in range(3):
            here, there = height[k], height[(k + 1) % 3]
            if here >= 0:
                points.append(triangle[k])
            if here * there < 0:
                points.append(triangle[k] + here / (here - there) * (triangle[(k + 1) % 3] - triangle[k]))
        found += [[points[0], points[k], points[k + 1]] for k in range(1, len(points) - 1)]
    return np.array(found).reshape(-1, 3, 3)


@pytest.mark.slow
@pytest.mark.parametrize(("rim", "turn"), [(1.06, 0.0), (1.073, 0.0), (1.087, 0.0), (1.06, 0.02), (1.073, 0.05)])
def test_a_ghost_that_a_wall_s_rim_cuts_is_that_of_what_is_left(radar, rim, turn):
    """Within the stated error, of single pairs, by the wall once: with its share of the whole facet's phase it would be
    5 to 31 % off at any tolerance. Rims are seen from the phase centre."""
    actor = plate(turn)
    simulator = Simulator(side_wall("pec", x=(-1.0, rim)), radar, [actor], rtol=3e-3, max_bounces=2)
    found = ways(of(simulator.paths()))
    error = simulator.tracer.trace(0.0, 0.0).report.error
    view, wall = np.array(radar.position), Wall(np.array([0, SIDE, 0]), np.array([0, 1.0, 0]), METAL)
    image = wall.image(view)
    corners = actor.vertices(0.0)[actor.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # What is behind the plane through the image and the rim, on the side of the wall.
    edge = np.array([rim, SIDE, 1.0]) - image
    normal = np.cross(edge, [0, 0, 1.0])
    normal *= np.sign(normal @ (np.array([0.0, SIDE, 1.0]) - image))
    level = []
    for way in ((False, True), (True, False)):
        facing = np.all([np.einsum("fi,fi->f", across, each - corners[:, 0]) > 0 for each in (view, image)], axis=0)
        left = kept(corners[facing], normal, normal @ image)
        for tx, rx in ((0, 0), (2, 3), (1, 0)):
            elements = radar.tx_world[tx], radar.rx_world[rx], radar.tx_field, radar.rx_field, radar.center_frequency
            walls = {"tx_wall": wall if way[0] else None, "rx_wall": wall if way[1] else None}
            truth = po_gain(left, *elements, n=150, **walls)
            whole = po_gain(corners[facing], *elements, n=150, **walls)
            level.append(abs(channel(found[way])[tx, rx] - truth) / max(abs(truth), 0.1 * abs(whole)))
            assert abs(whole - truth) > 0.1 * abs(whole)  # it is cut
    assert max(level) < error
