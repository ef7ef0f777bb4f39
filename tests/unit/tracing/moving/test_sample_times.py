"""At how many instants gains are traced."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.records import knot_weights
from rfgen_sionna.tracing.moving.representative_faces import _mean_phasor
from rfgen_sionna.tracing.moving.sample_times import MARGIN, choose_sample_times

FREQUENCY, LENGTH = 77e9, 27.6e-3
WAVENUMBER = 4 * np.pi * FREQUENCY / SPEED_OF_LIGHT
PLATE = np.array([[0, 1, 2], [2, 1, 3]], np.int32)


def turning(turn, across=0.0, size=0.004, away=3.0):
    """A plate that turns [rad/s] and moves across the line of sight [m/s]."""

    def positions(t):
        cos, sin = np.cos(turn * t), np.sin(turn * t)
        places = [[away + y * sin, y * cos + across * t, z] for y in (-size, size) for z in (-size, size)]
        return [np.array(places)]

    return positions


def chosen(positions, faces=PLATE, stop=0.02, tolerance=0.03, closed=False, knots=4, **more):
    times = np.linspace(0.0, stop, knots)
    return choose_sample_times(positions, [faces], [closed], np.zeros(3), times, FREQUENCY, tolerance, 10e-3, **more)


@given(st.tuples(*[st.floats(-20.0, 20.0)] * 3))
@settings(max_examples=200, deadline=None)
def test_the_mean_phasor_is_that_of_a_dense_sum(phases):
    """By the midpoints of 300^2 triangles, whose error goes with the square of what is left of the phase in each."""
    n = 300
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    up, down = i + j < n, i + j < n - 1
    middles = (
        np.concatenate([np.stack([i + 1 / 3, j + 1 / 3])[:, up], np.stack([i + 2 / 3, j + 2 / 3])[:, down]], axis=1) / n
    )
    u, v = middles
    truth = np.exp(-1j * (u * phases[0] + v * phases[1] + (1 - u - v) * phases[2])).mean()
    assert _mean_phasor(np.array(phases)[:, None])[0] == pytest.approx(truth, abs=1e-3)


@pytest.mark.parametrize("phases", [(0.3, 0.3, 0.3), (1.0, 1.0, 4.0), (1.0, 1.0 + 1e-6, 1.0 - 2e-6), (0.0, 1e-4, 2e-4)])
def test_mean_phasor_of_equal_phases(phases):
    near = np.array(phases) + np.array([1e-3, -1e-3, 2e-3])
    found = _mean_phasor(np.array([phases, near]).T)
    assert np.isfinite(found).all()
    assert abs(found[0] - found[1]) < 2e-3


@pytest.mark.parametrize(
    ("turn", "across", "stop", "gaps"),
    [(0.0, 0.0, 0.02, 2), (8.0, 2.0, 0.02, 2), (80.0, 0.0, 0.02, 3), (0.0, 8.0, 0.02, 3), (0.0, 0.0, 0.03, 3)],
)
def test_sample_times_of_a_plate(turn, across, stop, gaps):
    """Three while it hardly turns [rad/s] or goes across the view [m/s], over no more than twice the gap that is
    allowed then; else four or more."""
    found = chosen(turning(turn, across), stop=stop).times
    assert len(found) - 1 >= gaps
    assert (len(found) == 3) == (gaps == 2)
    assert found[[0, -1]] == pytest.approx([0.0, stop])


@pytest.mark.parametrize(
    ("across", "sway", "pair", "count"),
    [(0.0, 0.0, True, 2), (1.0, 0.0, True, 2), (2.0, 0.0, True, 3), (0.0, 1e-3, True, 3), (0.0, 0.0, False, 3)],
)
def test_two_sample_times_of_a_plate(across, sway, pair, count):
    """While it goes straight on and not far across the view [m/s]; not where it comes back from a millimetre."""

    def positions(t):
        return [turning(0.0, across)(t)[0] + [0, sway * np.sin(np.pi * t / 0.02), 0]]

    found = chosen(positions, pair=pair)
    assert len(found.times) == count


def missed_by(found, positions, faces=PLATE, stop=0.02):
    """Relative error of the spline through sample times for the faces' mean phasors, at 997 times."""
    times = np.linspace(0.0, stop, 997)

    def gain(t):
        phases = WAVENUMBER * np.linalg.norm(positions(t)[0], axis=1)[faces.T]
        return _mean_phasor(phases - phases.mean(axis=0)).sum()

    truth = np.array([gain(t) for t in times])
    missed = knot_weights(found.times, times) @ np.array([gain(t) for t in found.times]) - truth
    return np.sqrt((np.abs(missed) ** 2).mean() / (np.abs(truth) ** 2).mean())


@pytest.mark.parametrize("turn", [3.0, 10.0, 30.0, 100.0])
@pytest.mark.parametrize("tolerance", [0.03, 0.003])
def test_a_spline_through_them_misses_no_more_than_stated(turn, tolerance):
    """Of a plate that turns."""
    positions = turning(turn, size=0.01)
    found = chosen(positions, tolerance=tolerance, knots=25)
    error = missed_by(found, positions)
    assert error <= found.error * 1.05
    assert found.error <= tolerance
    assert error > found.error / (8 * MARGIN) or len(found.times) <= 4


@pytest.mark.parametrize("frequency", [200.0, 300.0, 397.0, 400.0, 403.0, 600.0, 800.0])
@pytest.mark.parametrize("indirect", [False, True])
def test_vibrations_in_step_with_the_frame_are_not_missed(frequency, indirect):
    """Of a plate that yaws by 0.05 rad, at knots that follow it; evenly spaced test times would miss it."""

    def positions(t):
        return turning(0.05 * np.sin(2 * np.pi * frequency * t))(1.0)

    found = chosen(positions, knots=193, indirect=indirect)
    assert missed_by(found, positions) <= 1.5 * found.error + 1e-4


@pytest.mark.parametrize("tolerance", [0.03, 0.003])
def test_a_kink_in_a_turn_is_stated(tolerance):
    """Its error does not fall with the fourth power of the gap; the stated error is that of the chosen number."""

    def positions(t):
        return turning(20.0 * max(t - 7.3e-3, 0.0), size=0.01)(1.0)

    found = chosen(positions, tolerance=tolerance, knots=97)
    assert found.error <= tolerance
    assert missed_by(found, positions) <= found.error * 1.05


@pytest.mark.parametrize("turn", range(3))
def test_which_corner_comes_first_makes_no_difference(turn):
    """Of a floor whose first corner lies under the radar."""
    floor = np.array([[0.0, 0.0, -0.01], [0.0, 6.0, -1.0], [6.0, 0.0, -1.0]])
    moved = turning(30.0)

    def positions(t):
        return [np.concatenate([floor, moved(t)[0]])]

    faces = np.concatenate([np.roll([[0, 1, 2]], turn, axis=1), PLATE + 3]).astype(np.int32)
    plain = np.concatenate([[[0, 1, 2]], PLATE + 3]).astype(np.int32)
    assert chosen(positions, faces).error == pytest.approx(chosen(positions, plain).error, rel=1e-6)


def test_too_fast_a_turn_warns(caplog):
    found = chosen(turning(4000.0, size=0.3), tolerance=1e-6, knots=385)
    assert found.error > 1e-6
    found.warn()
    assert "turn too fast" in caplog.text


def test_a_tenth_of_the_tolerance_takes_nearly_twice_the_times():
    few, many = (len(chosen(turning(100.0, size=0.02), tolerance=each, knots=25).times) - 1 for each in (1e-2, 1e-3))
    assert 1.5 * few < many < 2.0 * few + 1


def test_back_faces_of_a_closed_body_do_not_count():
    """A still plate faces the radar; another one turns with its back or its front to it."""
    still, turned = turning(0.0), turning(30.0)
    towards = PLATE if trimesh.Trimesh(still(0.0)[0], PLATE).face_normals[0, 0] < 0 else PLATE[:, ::-1]

    def positions(t):
        return [np.concatenate([*still(t), *turned(t)])]

    def error(of_turned, closed):
        return chosen(positions, np.concatenate([towards, of_turned + 4]), tolerance=1.0, closed=closed).error

    assert error(towards[:, ::-1], closed=True) < 1e-6
    assert error(towards, closed=True) == pytest.approx(error(towards, closed=False))
    assert error(towards, closed=True) == pytest.approx(error(towards[:, ::-1], closed=False), rel=0.01)
    assert error(towards, closed=True) > 1e-3


def test_mirrors_need_four_times_and_a_quarter_of_the_error():
    found = chosen(turning(30.0, size=0.01), indirect=True)
    assert len(found.times) >= 4
    assert found.error <= 0.25 * 0.03


def test_no_mesh_and_no_time():
    assert (
        len(choose_sample_times(lambda t: [], [], [], np.zeros(3), np.array([0.5]), FREQUENCY, 0.03, 0.01).times) == 1
    )
    empty = chosen(lambda t: [np.zeros((0, 3))], np.zeros((0, 3), np.int32))
    assert empty.error == 0.0
    assert len(empty.times) == 3


@pytest.mark.parametrize("seed", range(3))
def test_a_large_face_counts_among_thousands_of_small_ones(seed):
    """A plate of two triangles that turns beside a ball that stands, in whatever order the faces come: as many instants
    as for the plate alone, but for what the ball returns as well."""
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.1)
    moved = turning(3.0, size=0.5)

    def positions(t):
        return [np.concatenate([ball.vertices + np.array([3.0, 2.0, 0.0]), moved(t)[0]])]

    faces = np.concatenate([ball.faces, PLATE + len(ball.vertices)]).astype(np.int32)
    faces = faces[np.random.default_rng(seed).permutation(len(faces))]
    alone = chosen(moved, tolerance=1e-3, knots=25)
    found = chosen(positions, faces, tolerance=1e-3, knots=25)
    assert len(found.times) >= len(alone.times) - 1
    assert found.error > 0.2 * alone.error


@pytest.mark.parametrize("seed", range(3))
def test_representatives_of_weak_faces(seed):
    """Four thousand small plates, half of which turn: the stated error is that of their incoherent sum."""
    rng = np.random.default_rng(seed)
    count = 4000
    places = np.array([4.0, 0.0, 0.0]) + rng.uniform(-0.5, 0.5, (count, 1, 3))
    shapes = 0.004 * rng.normal(size=(count, 3, 3))
    speed = np.where(rng.random(count) < 0.5, 40.0, 0.0)

    def positions(t):
        cos, sin = np.cos(speed * t), np.sin(speed * t)
        zero, one = np.zeros(count), np.ones(count)
        turn = np.moveaxis(np.array([[cos, -sin, zero], [sin, cos, zero], [zero, zero, one]]), 2, 0)
        return [(places + shapes @ turn).reshape(-1, 3)]

    faces = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    found = chosen(positions, faces, tolerance=0.01, knots=25)
    times = np.linspace(0.0, 0.02, 101)

    def gains(t):
        away = positions(t)[0]
        phases = WAVENUMBER * np.linalg.norm(away, axis=1)[faces.T]
        a, b, c = np.moveaxis(away.reshape(-1, 3, 3), 1, 0)
        area = np.abs(np.einsum("fi,fi->f", a, np.cross(b - a, c - a))) / np.linalg.norm(a, axis=1) ** 3
        return area * _mean_phasor(phases - phases.mean(axis=0))

    truth = np.stack([gains(t) for t in times])
    missed = knot_weights(found.times, times) @ np.stack([gains(t) for t in found.times]) - truth
    error = np.sqrt((np.abs(missed) ** 2).sum() / (np.abs(truth) ** 2).sum())
    assert 0.5 * found.error < MARGIN * error < 1.6 * found.error
