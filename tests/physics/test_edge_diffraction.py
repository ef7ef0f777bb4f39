"""Oracles of corner reflectors: physical optics on all plates against images."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.physics.test_corners import radar_of
from tests.reference.corners import Side, corner_gain
from tests.reference.plate_waves import corner_wave

SLOW = pytest.mark.slow
KINDS = {"dihedral": 2, "trihedral": 3}


def one_pair(gigahertz, polarisation="V"):
    """A radar of one Tx and one Rx at the origin, looking along x."""
    radar, place = radar_of(gigahertz), np.zeros((1, 3))
    elements = {"tx_positions": place, "rx_positions": place, "tx_names": ("T",), "rx_names": ("R",)}
    fields = {"tx_polarization": polarisation, "rx_polarization": polarisation}
    return replace(radar, waveform=replace(radar.waveform, tx_order=(0,)), **elements, **fields)


def corner(kind, widths, distance, angles):
    """Metal sides that open to the radar, turned by yaw, pitch and roll `angles` [degrees]."""
    if kind == "dihedral":
        edges = Rotation.from_euler("z", 135, degrees=True).apply(np.diag(widths))
        low = -0.5 * edges[2]
        sides = [(low, edges[0], edges[2]), (low, edges[2], edges[1])]
    else:
        turn, _ = Rotation.align_vectors([[-1, 0, 0]], [np.ones(3) / np.sqrt(3)])
        edges = turn.apply(np.diag(widths))
        sides = [(np.zeros(3), edges[k], edges[(k + 1) % 3]) for k in range(3)]
    turn = Rotation.from_euler("zyx", angles, degrees=True)
    place = np.array([distance, 0.0, 0.0])
    return [Side(place + turn.apply(low), turn.apply(u), turn.apply(v)) for low, u, v in sides]


def test_direct_returns_have_no_such_error_and_the_oracles_agree_on_them():
    radar, sides = one_pair(24), corner("dihedral", (0.1, 0.07, 0.12), 1.0, (12, 3, 0))
    ends = np.zeros(3), np.zeros(3), radar.tx_field, radar.rx_field, radar.center_frequency
    one, other = corner_wave(sides, 1, *ends, n=80), corner_gain(sides, 1, *ends, n=800)
    assert abs(one / other - 1) < 1e-3


def test_the_oracle_tends_to_geometrical_optics_where_plates_are_wide():
    """Its corner of two plates is nearer to that of images, the larger it is against the wavelength."""
    radar, found = one_pair(24), []
    ends = np.zeros(3), np.zeros(3), radar.tx_field, radar.rx_field, radar.center_frequency
    for size in (0.04, 0.16):
        sides = corner("dihedral", (size, size, size), 40 * size, (0, 0, 0))
        n = int(20 + 3.4 * size / radar.wavelength)
        found.append(abs(corner_wave(sides, 2, *ends, n=n) / corner_gain(sides, 2, *ends, n=400) - 1))
    assert found[1] < 0.75 * found[0]
