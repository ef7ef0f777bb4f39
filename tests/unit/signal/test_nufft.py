"""The kernel and its taps against sums from the definition."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.scene.mitsuba_backend import ensure_llvm, has_cuda
from rfgen_sionna.signal import synthesize
from rfgen_sionna.signal.nufft import ChirpTable, nonuniform_fft, single_precision_suffices
from rfgen_sionna.signal.nufft_kernel import deconvolution, interpolation_kernel, value, width_for
from rfgen_sionna.signal.synthesis import chosen_device
from tests.unit.signal.test_waveforms import RADARS

TERMS = {
    "points": [(0, 0)],
    "quadratic phase": [(0, n) for n in range(5)],
    "gain over the band": [(m, n) for m in range(4) for n in range(5)],
}


def lanes_of(rng, paths, orders, quadratic=0.02, lanes=5):
    """Two stretches of three coefficients each, and lanes with weights of their own that add up to 1."""
    table = np.zeros((2, 3, paths, -(-(3 + 2 * orders) // 4) * 4))
    table[..., 0] = rng.uniform(-1e3, 1e3, (2, 3, paths))
    table[..., 1] = rng.uniform(-1.5, 1.5, (2, 1, paths)) + rng.uniform(-0.01, 0.01, (2, 3, paths))
    table[..., 2] = rng.uniform(-quadratic, quadratic, (2, 3, paths))
    table[..., 3 : 3 + 2 * orders] = rng.normal(size=(2, 3, paths, 2 * orders))
    weights = rng.uniform(0, 1, (lanes, 3))
    weights /= weights.sum(axis=1, keepdims=True)
    return ChirpTable(table.reshape(6, paths, -1), 3 * (np.arange(lanes) % 2), weights)


def definition(lanes, orders, count):
    """(lane, count)"""
    modes = np.arange(count) - count // 2
    u = modes / (count / 2)
    out = []
    for row, weights in zip(lanes.rows, lanes.weights, strict=True):
        phase, beat, quadratic, *gains = np.tensordot(weights, lanes.table[row : row + 3], axes=1).T[: 3 + 2 * orders]
        cycles = phase[:, None] + beat[:, None] * modes + quadratic[:, None] * (2 * u * u - 1)
        pairs = zip(gains[::2], gains[1::2], strict=True)
        gain = sum((re + 1j * im)[:, None] * u**m for m, (re, im) in enumerate(pairs))
        out.append((gain * np.exp(2j * np.pi * cycles)).sum(axis=0))
    return np.array(out)


def relative(found, truth):
    return np.linalg.norm(found - truth) / np.linalg.norm(truth)


@pytest.fixture(autouse=True)
def llvm():
    ensure_llvm()


@pytest.mark.parametrize("kind", TERMS)
@pytest.mark.parametrize("count", [256, 255, 64, 5, 1])
@pytest.mark.parametrize("shares", [1, 3])
def test_the_kernel_sums_as_it_says(kind, count, shares):
    rng = np.random.default_rng(count)
    orders = 4 if kind == "gain over the band" else 1
    lanes = lanes_of(rng, 300, orders, 0.0 if kind == "points" else 0.02)
    found = nonuniform_fft(lanes, count, TERMS[kind], 12, 1e-9, "cpu", shares=shares)
    assert relative(found, definition(lanes, orders, count)) < 2e-7


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda", marks=pytest.mark.gpu)])
@pytest.mark.parametrize("kind", TERMS)
def test_single_precision_costs_what_is_reckoned_with(kind, device):
    """Phases of 40 cycles, as a walker's over a frame: the error of taps that are far better is the rounding's."""
    if device == "cuda" and not has_cuda():
        pytest.fail("this test was asked for by -m gpu, but there is no CUDA device")
    rng = np.random.default_rng(4)
    orders = 4 if kind == "gain over the band" else 1
    lanes = lanes_of(rng, 300, orders, 0.0 if kind == "points" else 0.02, 9)
    lanes.table[..., 0] *= 0.04
    phase, beat = lanes.table[..., 0], lanes.table[..., 1]
    allowed = next(eps for eps in np.geomspace(1e-6, 1e-2, 200) if single_precision_suffices(phase, beat, 256, eps))
    assert allowed < 3e-4
    single = replace(lanes, table=lanes.table.astype(np.float32))
    found = nonuniform_fft(single, 256, TERMS[kind], 10, allowed, device)
    assert 1e-7 < relative(found, definition(lanes, orders, 256)) < 0.1 * allowed


def test_lanes_of_one_row_go_together():
    """However many there are of each, and in whatever order rows come."""
    rng = np.random.default_rng(5)
    lanes = lanes_of(rng, 40, 1, 0.0, 11)
    rows = 3 * np.array([0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 1])
    lanes = replace(lanes, rows=rows)
    assert relative(nonuniform_fft(lanes, 64, TERMS["points"], 12, 1e-9, "cpu"), definition(lanes, 1, 64)) < 1e-7


def test_the_same_lanes_give_the_same_bits():
    lanes = lanes_of(np.random.default_rng(1), 500, 1, lanes=64)
    found = [nonuniform_fft(lanes, 64, TERMS["points"], 7, 1e-6, "cpu") for _ in range(3)]
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])


@pytest.mark.parametrize("width", [2, 5, 8, 11, 14])
@pytest.mark.parametrize("term", [(0, 0), (1, 0), (0, 1), (2, 1), (0, 2)])
def test_taps_err_by_what_they_say(width, term):
    """At places and modes between those that they were fitted to."""
    found = interpolation_kernel(width, term)
    count = 101
    modes = np.arange(count) - count // 2
    u = modes / (count / 2)
    errors = []
    for place in np.linspace(0.003, 0.997, 31):
        at = np.polynomial.polynomial.polyval(2 * place - 1, found.coefficients.T) * (1j if found.odd else 1)
        cells = np.arange(width) + place - width / 2
        sums = np.exp(1j * np.pi * np.outer(modes, cells) / count) @ at * deconvolution(width, count)
        errors.append(np.mean(np.abs(sums - value(term, u)) ** 2))
    assert np.sqrt(np.mean(errors)) < 2 * found.error + 1e-12


def test_width_follows_the_tolerance():
    assert [width_for({(0, 0): 1.0}, eps) for eps in (1e-2, 1e-4, 1e-6, 1e-9)] == [3, 5, 7, 10]
    assert width_for({(0, 0): 1.0, (0, 1): 0.05, (0, 2): 1e-3}, 1e-6) == 8
    assert width_for({(0, 0): 1.0}, 1e-30) == 14


def test_devices_that_are_not_there(monkeypatch):
    with pytest.raises(ValueError, match=r"device is 'gpu'; allowed: auto, cpu, cuda"):
        chosen_device("gpu")
    monkeypatch.setattr("rfgen_sionna.signal.synthesis.has_cuda", lambda: False)
    assert chosen_device("auto") == chosen_device("cpu") == "cpu"
    with pytest.raises(ValueError, match=r"device is 'cuda', but no CUDA driver with a device"):
        chosen_device("cuda")
    monkeypatch.setattr("rfgen_sionna.signal.synthesis.has_cuda", lambda: True)
    assert (chosen_device("auto"), chosen_device("cuda"), chosen_device("cpu")) == ("cuda", "cuda", "cpu")


@pytest.mark.gpu
@pytest.mark.parametrize("kind", TERMS)
def test_the_kernel_sums_alike_on_a_gpu(kind):
    if not has_cuda():
        pytest.fail("this test was asked for by -m gpu, but there is no CUDA device")
    orders = 4 if kind == "gain over the band" else 1
    lanes = lanes_of(np.random.default_rng(3), 3000, orders, 0.0 if kind == "points" else 0.02, 128)
    found = [nonuniform_fft(lanes, 256, TERMS[kind], 10, 1e-9, "cuda") for _ in range(2)]
    np.testing.assert_array_equal(*found)
    assert relative(found[0], nonuniform_fft(lanes, 256, TERMS[kind], 10, 1e-9, "cpu")) < 1e-10
    assert relative(found[0], definition(lanes, orders, 256)) < 1e-6


def test_frames_go_through_a_device_by_name():
    """`synthesize` hands the device on: the name of one that is not there is refused before anything else."""
    with pytest.raises(ValueError, match="device is 'tpu'"):
        synthesize(RADARS["tdm"], _paths(RADARS["tdm"]), 0.0, device="tpu")
    found = synthesize(RADARS["tdm"], _paths(RADARS["tdm"]), 0.0, device="cpu")
    assert np.abs(found).max() > 0


def _paths(radar):
    from rfgen_sionna.records import RadarPaths

    shape = (len(radar.tx_names), len(radar.rx_names), 1, 1)
    direction = np.broadcast_to([1.0, 0, 0], (1, 1, 3))
    zero = np.zeros(1, np.int32)
    return RadarPaths(
        np.ones(shape, complex), np.full(shape, 2e-8), np.full(shape, 1e-8), np.zeros(1), 77e9, direction, direction,
        zero, zero, zero.astype(np.uint8), zero.astype(np.uint8), ("thing",), ("thing",), zero,
    )  # fmt: skip
