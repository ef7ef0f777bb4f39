"""What a person moved by the learned model returns: Doppler as fast as the mesh moves, and no faster."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.signal import synthesize
from rfgen_sionna.tracing.tracer import Tracer

pytest.importorskip("anny")
pytest.importorskip("diffusers")

from rfgen_sionna.generative.actor import Actor


@pytest.mark.slow
def test_generated_walking_shows_the_speeds_of_its_mesh_and_no_others() -> None:
    """Legs faster than the trunk; a thousandth of the power at most beyond the fastest visible vertices.

    Stairs or clicks between the model's poses (20 Hz) would spread power over the whole band.
    """
    radar = Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    fast = replace(
        radar,
        waveform=replace(radar.waveform, tx_order=(0,), num_loops=384, num_samples=32),
        tx_positions=radar.tx_positions[:1],
        tx_names=radar.tx_names[:1],
        rx_positions=radar.rx_positions[:1],
        rx_names=radar.rx_names[:1],
    )
    person = Actor.from_prompt("a person walking back and forth", seed=1, radar=fast, duration=4.0, motion="diffusion")
    tracer = Tracer(None, fast, [person])
    resolution = fast.wavelength / (2 * fast.waveform.frame_length)
    axis = np.fft.fftshift(np.fft.fftfreq(384, fast.waveform.loop_period)) * fast.wavelength / 2
    legs, trunk = [], []
    for start in (0.6, 1.0, 1.3):
        paths = tracer.trace(start, start + fast.waveform.frame_length).moving
        middle = start + 0.5 * fast.waveform.frame_length
        offset = person.vertices(middle) - np.asarray(fast.position)
        velocity = (person.vertices(middle + 1e-3) - person.vertices(middle - 1e-3)) / 2e-3
        speed = np.einsum("ij,ij->i", velocity, offset) / np.linalg.norm(offset, axis=1)
        slow = synthesize(fast, paths, start)[:, 0, 0]
        spectrum = np.fft.fftshift(np.abs(np.fft.fft(slow * np.hanning(384)[:, None], axis=0)) ** 2, axes=0).sum(axis=1)
        visible = speed[np.unique(person.faces[paths.facet])]
        outside = (axis < visible.min() - 3 * resolution) | (axis > visible.max() + 3 * resolution)
        assert spectrum[outside].sum() < 1e-3 * spectrum.sum()
        for group, names in ((legs, ("shank", "foot")), (trunk, ("torso",))):
            parts = [k for k, name in enumerate(paths.part_names) if any(n in name for n in names)]
            own = speed[np.unique(person.faces[np.isin(person.face_parts, parts)])]
            group.append(np.abs(own).max())
    assert max(legs) > 1.5 * max(trunk) > 0.0
