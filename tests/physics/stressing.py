"""What the stress tests share: a radar of one element, its channel and the truth."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import trimesh
from hypothesis import HealthCheck, settings

from rfgen_sionna.radar import ElementPattern, Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.tracing.tracer import Tracer
from tests.reference.physical_optics import po_gain

FEW = settings(max_examples=6, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))


def one_element(**waveform) -> Radar:
    """An isotropic element that sends and receives, with a frame of few samples."""
    radar = replace(Radar.load("awr1843", "mmmesh"), pattern=ElementPattern(0.0), tx_power_dbm=30.0)
    here = np.zeros((1, 3))
    small = {"tx_order": (0,), "num_loops": 4, "num_samples": 32} | waveform
    return replace(
        radar,
        waveform=replace(radar.waveform, **small),
        tx_positions=here,
        tx_names=radar.tx_names[:1],
        rx_positions=here,
        rx_names=radar.rx_names[:1],
    )


@cache
def far_radar() -> Radar:
    """One whose range window ends beyond a kilometre."""
    return one_element(slope=0.5e12)


def plate(width: float, height: float) -> trimesh.Trimesh:
    """Two triangles across the x axis that look to -x."""
    a, b = width / 2, height / 2
    return trimesh.Trimesh([[0, -a, -b], [0, a, -b], [0, a, b], [0, -a, b]], [[0, 2, 1], [0, 3, 2]], process=False)


def channel(paths, at: int = 0) -> complex:
    """Coherent sum of the first element pair at one knot."""
    turns = np.mod(paths.frequency * paths.tau[0, 0, :, at], 1.0)
    return complex((paths.a[0, 0, :, at] * np.exp(-2j * np.pi * turns)).sum())


def traced(radar: Radar, *actors: MeshActor, rtol: float = 1e-3):
    """Channel at t = 0 and the error that the report states."""
    found = Tracer(None, radar, actors, rtol).trace(0.0, 0.0)
    for array in (found.moving.a, found.moving.tau, found.moving.tau_rate, found.moving.direction):
        assert np.isfinite(array).all()
    return channel(found.moving), found.report.error


def true_channel(actor: MeshActor, radar: Radar, n: int, permeability: complex = 1.0) -> complex:
    """Dense quadrature over all faces, n^2 points each: for what hides nothing of itself."""
    element, frequency = radar.tx_world[0], radar.center_frequency
    corners = actor.vertices(0.0)[actor.faces]
    eps = complex(actor.properties.relative_permittivity(frequency))
    return po_gain(
        corners, element, element, radar.tx_field, radar.rx_field, frequency,
        complex(np.inf) if not np.isfinite(eps) else eps, permeability, n=n,
    )  # fmt: skip
