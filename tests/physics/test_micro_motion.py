"""A chest's breath and a pendulum's swing: traced from frame to frame, phases follow their analytic law."""

import numpy as np
import pytest
import trimesh

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import SPEED_OF_LIGHT
from rfgen_sionna.scene import Actor
from rfgen_sionna.scene.mesh import RigidMesh
from rfgen_sionna.simulation import Simulator

DISTANCE, RADIUS = 2.0, 0.1
BALL = trimesh.creation.icosphere(subdivisions=3, radius=RADIUS)


class Breathing(RigidMesh):
    """A ball whose radius changes by a tenth of a millimetre at 0.3 Hz."""

    def vertices(self, t):
        return self.points * (radius(t) / RADIUS)


def radius(t):
    return RADIUS + 1e-4 * np.sin(2 * np.pi * 0.3 * t)


def swing(t):
    """Centre (3,) [m] of a ball on a string of 1 m below (DISTANCE, 0, 1), swinging by 10 degrees towards the radar."""
    angle = np.radians(10.0) * np.cos(np.sqrt(9.81) * t)
    return np.array([DISTANCE - np.sin(angle), 0.1 * np.sin(angle), 1.0 - np.cos(angle)])


MOTIONS = {
    "breath": (
        lambda: Actor(Breathing(BALL.vertices, BALL.faces), "pec", "chest", position=(DISTANCE, 0, 0)),
        lambda t: np.array([DISTANCE, 0.0, 0.0]),
        radius,
    ),
    "pendulum": (
        lambda: Actor.from_mesh(BALL, material="pec", trajectory=lambda t: tuple(swing(t))),
        swing,
        lambda t: RADIUS,
    ),
}


@pytest.mark.parametrize("motion", MOTIONS)
def test_phase_follows_the_motion_over_seconds(motion):
    """Twelve frames over 3.3 s, a breath's and nearly two swings' length, at the default tolerance: within 0.1 degrees,
    root mean square, of -2 pi f tau for the length of the way to the ball's nearest point and back."""
    make, centre, size = MOTIONS[motion]
    radar = Radar.load("awr1843", "mmmesh", overrides={"pattern": {"kind": "sionna:iso"}})
    tracer = Simulator(None, radar, [make()]).tracer
    run, off = tracer.follow(), []
    for start in np.linspace(0.0, 3.3, 12):
        paths = tracer.trace(start, start + radar.waveform.frame_length, run).moving
        times = np.linspace(start, start + radar.waveform.frame_length, 20)
        weights = paths.weights(times).T
        a, tau = paths.a[0, 0] @ weights, paths.tau[0, 0] @ weights
        found = (a * np.exp(-2j * np.pi * np.mod(paths.frequency * tau, 1.0))).sum(axis=0)
        for value, t in zip(found, times, strict=True):
            ends = radar.tx_world[0], radar.rx_world[0]
            length = sum(np.linalg.norm(centre(t) - end) for end in ends) - 2 * size(t)
            off.append(value * np.exp(2j * np.pi * np.mod(paths.frequency * length / SPEED_OF_LIGHT, 1.0)))
    phase = np.degrees(np.angle(np.array(off) / np.mean(off)))
    assert np.sqrt(np.mean(phase**2)) < 0.1
