"""Chains give the same for tensors of PyTorch as for arrays, on the tensor's device."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.processing import drai, range_azimuth, range_doppler, range_spectrum
from rfgen_sionna.processing.boards import BoardPoints, CfarSettings, OutOfBoxChain, mmmesh_points, out_of_box_points
from rfgen_sionna.processing.boards.range_cfar import MODES, noise_level
from rfgen_sionna.radar import Radar

torch = pytest.importorskip("torch")

WORDS = OutOfBoxChain(full_scale_dbm=None)
CHAINS = {
    "sdk 2": WORDS,
    "ungrouped": replace(WORDS, group_doppler=False, second_peak=None),
    "sdk 3": replace(
        WORDS, clutter_removal=True, group_range=True, doppler_cfar=CfarSettings("ca", 2, 1, 6.0, cyclic=True)
    ),
    "floats": replace(WORDS, integers=False),
}


@pytest.fixture(params=["cpu", pytest.param("cuda", marks=pytest.mark.gpu)])
def device(request: pytest.FixtureRequest) -> str:
    if request.param == "cuda" and not torch.cuda.is_available():
        pytest.fail("this test was asked for by -m gpu, but there is no CUDA device")
    return str(request.param)


@pytest.fixture(scope="module")
def radar() -> Radar:
    return Radar.load("iwr1443boost", preset="radhar")


def room(rng: np.random.Generator) -> list[tuple[Any, Any, complex]]:
    """Walls and a person: 20 static points of 100 to 1,000 words, and 12 that move at up to 2 m/s."""
    bearing = rng.uniform(-0.6, 0.6, 32)
    height = rng.uniform(-0.3, 0.3, 32)
    towards = np.stack([np.cos(bearing), np.sin(bearing), height], axis=1)
    distance = np.concatenate([rng.uniform(1, 6, 20), rng.uniform(1.8, 2.2, 12)])
    speed = np.concatenate([np.zeros(20), rng.uniform(-2, 2, 12)])
    level = np.concatenate([10 ** rng.uniform(2, 3, 20), rng.uniform(20, 80, 12)])
    return [(d * u, v * u, a) for d, u, v, a in zip(distance, towards, speed, level, strict=True)]


@pytest.fixture(scope="module")
def words(radar: Radar, synthesise: Callable[..., np.ndarray]) -> np.ndarray:
    """Samples as a board's ADC has them, whole numbers: a person in a room, with the receiver's noise."""
    cube = synthesise(radar, room(np.random.default_rng(0)), frames=4, noise=16.0)
    return (np.round(cube.real) + 1j * np.round(cube.imag)).astype(np.complex64)


def cells(points: BoardPoints) -> list[tuple[int, ...]]:
    return list(zip(points.frame.tolist(), points.doppler_bin.tolist(), points.range_bin.tolist(), strict=True))


@pytest.mark.parametrize("name", CHAINS)
def test_points_of_the_demonstration_in_double_precision_are_equal(
    radar: Radar, words: np.ndarray, device: str, name: str
) -> None:
    chain = CHAINS[name]
    expected = out_of_box_points(words.astype(np.complex128), radar, chain)
    found = out_of_box_points(torch.as_tensor(words.astype(np.complex128), device=device), radar, chain)
    assert len(expected) > 20
    assert any(expected.doppler_bin)
    assert cells(found) == cells(expected)
    assert isinstance(found.position, np.ndarray)
    tolerance = 0.0 if chain.integers else 1e-9
    np.testing.assert_allclose(found.position, expected.position, atol=tolerance)
    np.testing.assert_allclose(found.peak, expected.peak, rtol=tolerance)
    np.testing.assert_allclose(found.snr_db, expected.snr_db, rtol=1e-9)


@pytest.mark.parametrize("name", CHAINS)
def test_points_of_the_demonstration_in_single_precision_are_equal_but_for_rounding(
    radar: Radar, words: np.ndarray, device: str, name: str
) -> None:
    """A bin that lies between two whole numbers may be rounded to either, which moves a level by 1/512 of a bit."""
    expected = out_of_box_points(words, radar, CHAINS[name])
    found = out_of_box_points(torch.as_tensor(words, device=device), radar, CHAINS[name])
    common = set(cells(found)) & set(cells(expected))
    assert len(common) >= 0.98 * max(len(set(cells(found))), len(set(cells(expected))))
    if cells(found) == cells(expected):
        np.testing.assert_allclose(found.snr_db, expected.snr_db, atol=0.2)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("cyclic", [False, True])
def test_noise_levels_are_equal(device: str, mode: str, cyclic: bool) -> None:
    level = np.random.default_rng(0).normal(size=(3, 24, 5))
    settings = CfarSettings(mode, 4, 2, cyclic=cyclic)
    found = noise_level(torch.as_tensor(level, device=device), settings, axis=1)
    assert found.device.type == device
    np.testing.assert_allclose(found.cpu().numpy(), noise_level(level, settings, axis=1), rtol=1e-12)


def test_points_of_mmmesh_are_equal(mmmesh: Radar, synthesise: Callable[..., np.ndarray], device: str) -> None:
    short = replace(mmmesh, waveform=replace(mmmesh.waveform, num_loops=16))
    cube = synthesise(short, room(np.random.default_rng(1)), frames=10, noise=16.0)  # more frames than a batch
    expected = mmmesh_points(cube, short)
    found = mmmesh_points(torch.as_tensor(cube, device=device), short)
    assert len(found) == 10
    for ours, theirs in zip(found, expected, strict=True):
        assert 64 < len(theirs) <= 128
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("board", "preset"),
    [
        ("awr1843", "di_gesture"),
        ("awr1843", "bpm"),
        ("awr1843", "ddm"),
        ("awr2944evm", None),
        ("position2go", "doppler"),
    ],
)
def test_spectra_and_images_are_equal_and_stay_on_the_device(device: str, board: str, preset: str | None) -> None:
    radar = Radar.load(board, preset=preset) if preset else Radar.load(board)
    radar = replace(radar, waveform=replace(radar.waveform, num_loops=16))
    rng = np.random.default_rng(0)
    shape = (2, *radar.frame_shape)
    cube = rng.normal(size=shape).astype(np.float32)
    if not radar.adc.real:
        cube = (cube + 1j * rng.normal(size=shape)).astype(np.complex64)
    tensor = torch.as_tensor(cube, device=device)
    for function in (
        lambda x: range_spectrum(x, radar),
        lambda x: range_doppler(x, radar, static=False).spectrum,
        lambda x: range_doppler(x, radar, correct_coupling=True).power,
        lambda x: range_azimuth(x, radar).power,
        lambda x: drai(x, radar, range_bins=1).image,
    ):
        expected, found = function(cube), function(tensor)
        assert isinstance(expected, np.ndarray)
        assert found.device.type == device
        assert str(found.dtype) == f"torch.{expected.dtype}"
        scale = np.abs(expected).max()
        np.testing.assert_allclose(found.cpu().numpy() / scale, expected / scale, atol=3e-6)


def test_maps_of_tensors_have_gradients(di_gesture: Radar) -> None:
    cube = torch.ones((1, 4, 2, 4, 128), dtype=torch.complex64, requires_grad=True)
    range_doppler(cube, di_gesture).power.sum().backward()
    assert float(cube.grad.abs().max()) > 0


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (lambda cube: cube.real, ValueError, r"cube holds torch\.float32: complex \(I \+ jQ\) samples are needed"),
        (lambda cube: cube.real.to(torch.int16), ValueError, r"cube holds torch\.int16: complex"),
        (lambda cube: cube[0], ValueError, r"cube has shape \(16, 3, 4, 240\)"),
        (lambda cube: cube[..., :2, :, :], ValueError, "2 entries along 'tx'"),
        (lambda cube: cube * float("nan"), ValueError, "samples that are NaN or infinite"),
        (lambda cube: [cube[0], cube[1].numpy()], TypeError, "cube is a list with tensors: one tensor is needed"),
    ],
)
def test_tensors_that_are_no_cubes_are_refused(
    radar: Radar, change: Callable[[Any], Any], error: type[Exception], message: str
) -> None:
    cube = torch.zeros((2, *radar.frame_shape), dtype=torch.complex64)
    with pytest.raises(error, match=message):
        out_of_box_points(change(cube), radar)


def test_migration_takes_arrays_alone(di_gesture: Radar) -> None:
    with pytest.raises(ValueError, match="correct_migration is True for a tensor"):
        range_doppler(torch.zeros((4, 2, 4, 128), dtype=torch.complex64), di_gesture, correct_migration=True)
