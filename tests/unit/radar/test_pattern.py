"""Element patterns: published cuts, sides, and what lies between the tabulated angles."""

from __future__ import annotations

import numpy as np
import pytest

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import ElementPattern, Radar, TablePattern


def towards(azimuth_deg: float, elevation_deg: float = 0.0) -> FloatArray:
    """Unit vector in the device frame: azimuth to the left, elevation upwards."""
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    return np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])


@pytest.mark.parametrize(
    ("azimuth", "elevation", "below"),
    [
        *((0, 0, 0.0), (31, 0, 3.0), (-31, 0, 3.0), (47, 0, 6.0), (-47, 0, 6.0), (63, 0, 10.0), (-63, 0, 10.0)),
        *((0, -15, 3.0), (0, 13, 3.0), (0, 20, 6.0), (0, -20, 6.0), (31, 13, 6.0)),
    ],
)
def test_the_awr1843_has_its_published_cuts(azimuth: float, elevation: float, below: float) -> None:
    """TI's simulated cuts; 7 dBi at the peak. The elevation cut peaks a little below boresight."""
    pattern = Radar.load("awr1843").pattern
    assert pattern.gain_db(towards(azimuth, elevation)) == pytest.approx(7.0 - below, abs=0.05)


def test_sides_are_told_apart() -> None:
    pattern = ElementPattern(0.0, (-90.0, 0.0, 90.0), (-9.0, 0.0, -1.0), (-90.0, 0.0, 90.0), (-8.0, 0.0, -2.0))
    assert pattern.gain_db(towards(90)) == pytest.approx(-1.0)  # left
    assert pattern.gain_db(towards(-90)) == pytest.approx(-9.0)
    assert pattern.gain_db(towards(0, 90)) == pytest.approx(-2.0)  # up
    assert pattern.gain_db(towards(0, -90)) == pytest.approx(-8.0)


def test_between_the_angles_nothing_overshoots_and_outside_the_end_stays() -> None:
    pattern = ElementPattern(5.0, (-60.0, -10.0, 10.0, 60.0), (-20.0, 0.0, 0.0, -20.0))
    azimuths = np.linspace(-180, 180, 721)
    gain = pattern.gain_db(np.stack([towards(a) for a in azimuths]))
    assert gain.shape == (721,)
    assert gain.max() <= 5.0 + 1e-12
    assert np.all(gain[np.abs(azimuths) <= 10] == pytest.approx(5.0))
    assert np.all(np.diff(gain[(azimuths >= 10) & (azimuths <= 60)]) < 0)
    assert np.all(gain[np.abs(azimuths) >= 60] == pytest.approx(-15.0))


def test_amplitude_is_the_root_of_the_gain_and_the_default_is_isotropic() -> None:
    pattern = ElementPattern(6.0)
    directions = np.random.default_rng(0).normal(size=(2, 5, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    np.testing.assert_allclose(pattern.gain_db(directions), np.full((2, 5), 6.0))
    np.testing.assert_allclose(pattern.amplitude(directions) ** 2, np.full((2, 5), 10**0.6))


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"azimuth_deg": (0.0,), "azimuth_db": (0.0,)}, "at least 2"),
        ({"azimuth_deg": (-10.0, 0.0, 10.0)}, "3 and 2 entries"),
        ({"azimuth_deg": (10.0, -10.0)}, "ascend"),
        ({"azimuth_deg": (-200.0, 200.0)}, "±180"),
        ({"elevation_deg": (-100.0, 90.0)}, "±90"),
        ({"elevation_db": (0.0, 3.0)}, "at most 0 dB"),
        ({"elevation_db": (0.0, float("nan"))}, "finite"),
        ({"azimuth_deg": (float("nan"), 90.0)}, "ascend"),
        ({"peak_gain_dbi": 1e3}, "-30 … 60 dBi"),
        ({"peak_gain_dbi": float("nan")}, "-30 … 60 dBi"),
    ],
)
def test_impossible_patterns_are_named(fields: dict[str, object], said: str) -> None:
    arguments: dict[str, object] = {"peak_gain_dbi": 7.0} | fields
    with pytest.raises(ValueError, match=rf"^pattern\..*{said}"):
        ElementPattern(**arguments)  # type: ignore[arg-type]


def across(direction: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Random unit vectors across unit vectors."""
    found = np.cross(direction, rng.normal(size=direction.shape))
    return np.asarray(found / np.linalg.norm(found, axis=1)[:, None])


@pytest.mark.parametrize("kind", ["cuts", "table"])
@pytest.mark.parametrize("name", ["awr1843", "mmwcas", "position2go"])
def test_slopes_are_what_a_small_turn_makes_of_the_gain(name: str, kind: str) -> None:
    """Whichever way it goes, in front; along the direction itself nothing changes."""
    pattern, step = Radar.load(name).pattern, 1e-4
    if kind == "table":
        azimuth, elevation = np.linspace(-90, 90, 361), np.linspace(-90, 90, 361)
        grid = np.moveaxis(np.array([[towards(a, e) for e in elevation] for a in azimuth]), -1, 0)
        pattern, step = TablePattern.of(azimuth, elevation, pattern.gain_db(np.moveaxis(grid, 0, -1))), np.radians(0.5)
    rng = np.random.default_rng(0)
    direction = np.stack([towards(*each) for each in rng.uniform(-60, 60, (500, 2))])
    aside = across(direction, rng)
    ahead, back = (pattern.gain_db(np.cos(step) * direction + np.sin(each) * aside) for each in (step, -step))
    slope = pattern.slope_db(direction)
    # Slopes bend at the cuts' own angles, and a table is flat between its own.
    off = np.abs(np.einsum("di,di->d", slope, aside) - (ahead - back) / (2 * step))
    assert np.median(off) < (1e-3 if kind == "cuts" else 0.5)
    assert off.max() < (0.05 if kind == "cuts" else 0.1) * np.abs(slope).max()
    assert np.abs(np.einsum("di,di->d", slope, direction)).max() < 1e-9 * np.abs(slope).max()


def test_what_is_the_same_all_around_has_no_slope() -> None:
    assert (
        not ElementPattern(3.0).slope_db(np.stack([towards(a, e) for a in (-170, 0, 90) for e in (-90, 0, 80)])).any()
    )
