"""CFAR keeps its false alarm rate; peaks are found between bins."""

import numpy as np
import pytest

from rfgen_sionna.processing.detection import ca_factor, cfar, local_maxima, os_factor, refine_peaks


@pytest.mark.parametrize("looks", [1, 4])
@pytest.mark.parametrize("method", ["ca", "os"])
def test_the_false_alarm_rate_is_the_one_asked_for(method, looks):
    rng = np.random.default_rng(5)
    noise = 3.0 * rng.gamma(looks, 1 / looks, (400, 250))
    detected, level = cfar(noise, method=method, false_alarm=1e-3, guard=(1, 1), train=(3, 2), looks=looks)
    # 100 expected; cells share training cells, so allow a wider spread than Poisson's 10.
    assert 60 < detected.sum() < 145
    assert level.mean() == pytest.approx(3.0, rel=0.03)


def test_the_cell_averaging_factor_is_the_closed_form():
    for cells, rate in ((16, 1e-4), (100, 1e-6)):
        assert ca_factor(rate, cells) == pytest.approx(cells * (rate ** (-1 / cells) - 1), rel=1e-9)


def test_the_ordered_statistic_factor_is_rohlings_product():
    cells, order, rate = 24, 18, 1e-4
    factor = os_factor(rate, cells, order)
    product = np.prod([(cells - i) / (cells - i + factor) for i in range(order)])
    assert product == pytest.approx(rate, rel=1e-3)


def test_ordered_statistics_see_the_target_beside_a_strong_one():
    rng = np.random.default_rng(1)
    power = rng.exponential(size=(64, 64))
    power[30, 30], power[30, 35] = 1e5, 1e3
    settings = {"false_alarm": 1e-5, "guard": (1, 1), "train": (4, 6)}
    assert cfar(power, method="os", **settings)[0][30, 35]
    assert not cfar(power, method="ca", **settings)[0][30, 35]


def test_targets_at_the_rims_are_seen_and_doppler_wraps():
    power = np.ones((40, 40))
    power[0, 39] = power[20, 0] = 100.0
    detected, _ = cfar(power, guard=(1, 1), train=(3, 3), false_alarm=1e-4)
    assert {tuple(cell) for cell in np.argwhere(detected)} == {(0, 39), (20, 0)}
    assert local_maxima(np.roll(power, 1, axis=1))[20, 1]


@pytest.mark.parametrize("offset", [(0.3, -0.4), (-0.5, 0.0), (0.1, 0.45)])
def test_a_parabola_finds_the_peak_between_bins_and_across_the_doppler_wrap(offset):
    row, column = np.meshgrid(np.arange(30), np.arange(-15, 15), indexing="ij")
    power = 7 * np.exp(-0.2 * (row - 12 - offset[0]) ** 2 - 0.3 * (column - offset[1]) ** 2)
    power = np.roll(power, 15, axis=1)
    cell = np.argwhere(power == power.max())[:1]
    position, peak = refine_peaks(power, cell)
    assert position[0, 0] == pytest.approx(12 + offset[0], abs=1e-6)
    assert (position[0, 1] - offset[1] + 5) % 30 - 5 == pytest.approx(0, abs=1e-6)
    assert peak[0] == pytest.approx(7, rel=1e-6)


def test_bad_requests_are_named():
    with pytest.raises(ValueError, match="method is 'so'; allowed: 'ca', 'os'"):
        cfar(np.ones((64, 64)), method="so")
    with pytest.raises(ValueError, match=r"span \(21, 21\) cells; the map has \(20, 64\)"):
        cfar(np.ones((20, 64)))
    with pytest.raises(ValueError, match="false_alarm is 0"):
        cfar(np.ones((64, 64)), false_alarm=0)
    with pytest.raises(ValueError, match="powers >= 0"):
        cfar(-np.ones((64, 64)))
