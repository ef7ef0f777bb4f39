"""Tx and Rx may be changed over: nothing of what is traced may tell which of them sends.

That of the integral itself is in `test_facet_integral`; here it is about what the tracer chooses, expands and leaves
out, whole arrays and all bounces.
"""

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna import Actor, Radar, Simulator, load_scene

ALIKE = 1e-6
"""Relative; wanted of the tracer. Found: 1e-13."""


def swapped(radar):
    tx, rx = radar.tx_positions, radar.rx_positions
    return replace(
        radar, tx_positions=rx, rx_positions=tx, tx_names=tuple(f"TX{n}" for n in range(len(rx))),
        rx_names=tuple(f"RX{n}" for n in range(len(tx))),
        waveform=replace(radar.waveform, tx_order=tuple(range(len(rx)))),
    )  # fmt: skip


def differences(scene, radar, actors, **options):
    """By actors or scene and number of bounces: relative difference of all element pairs, by the strongest one's."""
    both = [Simulator(scene, each, actors, **{"rtol": 1e-3, **options}).paths(0.2) for each in (radar, swapped(radar))]
    names = {actor.name for actor in actors}
    found = {}
    for moving in (True, False):
        for bounces in (1, 2, 3):
            channels = []
            for paths in both:
                own = np.array([paths.object_names[number] in names for number in paths.object_id]) == moving
                own &= paths.bounces == bounces
                phasor = np.exp(-2j * np.pi * paths.frequency * paths.tau[:, :, own, 0])
                channels.append((paths.a[:, :, own, 0] * phasor).sum(axis=-1))
            there, back = channels[0], channels[1].T
            if there.any() or back.any():
                found[moving, bounces] = float(abs(there - back).max() / abs(there).max())
    return found


@pytest.mark.slow
def test_a_person_to_a_whole_array():
    """What its parts show of one another by glints is found by Newton's steps, near caustics not to the last digit; and
    gains of all pairs are expanded from a middle that is Tx's as much as Rx's."""
    radar = Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    person = Actor.from_prompt(
        "a person walking back and forth, at 3 m", seed=0, radar=radar, duration=3.0, motion="kinematic"
    )
    found = differences(None, radar, [person], rtol=3e-2, max_bounces=2)
    assert found.keys() == {(True, 1), (True, 2)}
    assert max(found.values()) < ALIKE


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::rfgen_sionna.scene.scene_errors.MaterialRangeWarning")
def test_a_person_in_a_living_room_by_three_bounces():
    """Of either way round a ghost is expanded as finely as it asks for itself, whichever of them is traced first."""
    board = Radar.load("position2go", position=(0, 0, 1), look_at=(3, 0, 1))
    radar = replace(
        board, tx_positions=np.array([[0, -0.05, 0.01]]), rx_positions=np.array([[0, 0.04, 0.0]]), rx_names=("RX1",)
    )
    person = Actor.from_prompt(
        "a person walking back and forth, at 3 m", seed=0, radar=radar, duration=3.0, motion="kinematic"
    )
    found = differences(load_scene("living_room"), radar, [person], rtol=3e-2, max_bounces=3)
    assert found.keys() == {(moving, bounces) for moving in (True, False) for bounces in (1, 2, 3)}
    assert max(found.values()) < ALIKE
