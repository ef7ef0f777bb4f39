"""The calibration that TI's demonstration prints makes the measured channels equal."""

from pathlib import Path

import numpy as np
import pytest

from rfgen_sionna.processing import read_cfg_calibration
from rfgen_sionna.radar import Radar


def text(bias: float, factors: np.ndarray) -> str:
    """The command with (tx, rx) factors, between others."""
    pairs = " ".join(f"{factor.real:.6f} {factor.imag:.6f}" for factor in factors.ravel())
    return f"sensorStop\nflushCfg\ncompRangeBiasAndRxChanPhase {bias} {pairs} % by corner reflector\nsensorStart\n"


def test_factors_are_of_tx_and_rx_by_their_numbers(tmp_path: Path) -> None:
    gains = np.exp(1j * np.arange(12).reshape(3, 4)) * (1 + 0.1 * np.arange(12).reshape(3, 4))
    path = tmp_path / "measured.cfg"
    path.write_text(text(0.07, 1 / gains))
    radar = Radar.load("awr1843", "di_gesture")  # TX1 and TX3
    found = read_cfg_calibration(path, radar)
    assert found.range_bias == 0.07
    np.testing.assert_allclose(found.gains, gains[[0, 2]], rtol=1e-4)
    rng = np.random.default_rng(0)
    samples = rng.standard_normal(radar.frame_shape) + 1j * rng.standard_normal(radar.frame_shape)
    measured = samples * found.gains[:, :, None]
    path.write_text(text(0.0, 1 / gains))
    ideal = read_cfg_calibration(path, radar).apply(measured, radar)
    np.testing.assert_allclose(ideal, samples, rtol=1e-4, atol=1e-4)


def test_turned_feeds_are_the_radars_own(tmp_path: Path) -> None:
    """The demonstration's factors of -1 on the ODS undo feeds that the radar file has already."""
    radar = Radar.load("iwr6843isk_ods")
    tx, rx = radar.feed_factors
    path = tmp_path / "ods.cfg"
    path.write_text(text(0.0, np.multiply.outer(tx, rx)))
    np.testing.assert_allclose(read_cfg_calibration(path, radar).gains, 1.0)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("sensorStop\n", "has no compRangeBiasAndRxChanPhase"),
        ("compRangeBiasAndRxChanPhase 0.0" + " 1 0" * 8, "has 16 numbers after the bias; radar 'awr1843' has TX3"),
        ("compRangeBiasAndRxChanPhase 0.0" + " 1 0" * 11 + " 1", "23 numbers after the bias"),
        ("compRangeBiasAndRxChanPhase 0.0" + " 1 zero" * 12, "needs a range bias and pairs of numbers"),
        ("compRangeBiasAndRxChanPhase 0.0" + " 0 0" * 12, "has the factor 0"),
    ],
)
def test_what_is_no_calibration_is_refused(tmp_path: Path, content: str, said: str) -> None:
    path = tmp_path / "plain.cfg"
    path.write_text(content)
    with pytest.raises(ValueError, match=r"plain\.cfg") as caught:
        read_cfg_calibration(path, Radar.load("awr1843"))
    assert said in str(caught.value)
