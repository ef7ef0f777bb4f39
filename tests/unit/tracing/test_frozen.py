"""Kernels that Python goes through once return what they would if it did so each time."""

import gc
from concurrent.futures import ThreadPoolExecutor
from unittest.mock import Mock

import numpy as np
import pytest

from rfgen_sionna.scene.arrays import Frozen, drjit_types
from rfgen_sionna.scene.transfer import upload
from rfgen_sionna.tracing import facet
from rfgen_sionna.tracing.facet import Nodes, by_curvature, facet_gains
from rfgen_sionna.tracing.obliquity import Media
from rfgen_sionna.tracing.reflected import Via
from rfgen_sionna.tracing.smooth import Bend

ACROSS = np.array([0.0, 0.0, 1.0])


def media(nodes, materials, thickness=np.inf):
    eps = np.linspace(5 - 2j, 6 - 1j, materials)
    drop = 1.0 - 0.01 * np.arange(nodes)[:, None]  # over the band
    ones = np.ones(materials)
    return Media(eps * drop, np.ones((nodes, materials), complex), thickness * ones, ones, eps * drop * 1.001)


def gains(count, nodes, kind, seed=0):
    """Of `count` facets 3 m away, at so many nodes, of a kind: every way through the kernel that asks for its own."""
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(count, 3, 3)) * 0.01 + np.array([3.0, 0, 0])
    places = np.zeros((nodes, 3))
    at = Nodes(places, places + 1e-3 * np.eye(3)[1], np.linspace(77e9, 81e9, nodes))
    rises, lifts = rng.normal(size=(2, count, 3, 3)) * 1e-4
    parts, middle = rng.integers(1, 4, count), corners.mean(axis=1)
    index = rng.integers(0, 2, count).astype(np.int32)
    if kind == "mixed":  # the flat first, then the bent ones among them

        def of(some, bent, into):
            bend = Bend(rises[some], None) if bent else None
            known = corners[some], index[some], media(nodes, 2), at, ACROSS, ACROSS, parts[some]
            return facet_gains(*known, True, bend=bend, reference=middle[some], into=into)

        found = by_curvature(rng.random(count) < 0.5, of)
    else:
        options = {
            "plain": {},
            "two places": {"origin": np.array([0.1, 0, 0]), "reference": middle},
            "parts": {"parts": parts, "reference": middle, "axes": np.eye(3)[:2]},
            "no axes": {"axes": np.zeros((0, 3)), "monostatic": True},
            "bent": {"parts": parts, "bend": Bend(rises, lifts), "axes": np.eye(3)[1:2], "monostatic": True},
            "antennas": {"pull": rng.normal(size=(count, 3)), "aim": middle, "monostatic": True},
            "mirror": {"via": Via(np.array([[0.0, 1, 0]]), np.array([-1.0]), media(nodes, 1), None, 0 * index)},
        }
        of_slabs = media(nodes, 2, 0.01) if kind == "plain" else media(nodes, 2)
        found = facet_gains(corners, index, of_slabs, at, ACROSS, ACROSS, **options[kind])
    return found.terms.copy(), found.tau.copy()


KINDS = ("plain", "two places", "parts", "no axes", "bent", "antennas", "mirror", "mixed")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("nodes", [1, 3])
def test_what_is_frozen_is_the_kernel_itself_to_the_bit(monkeypatch, kind, nodes):
    """Of many facets and of few, one after the other: what is kept of one size serves all."""
    for count in (40, 3000, 7, 2, 41):
        frozen = gains(count, nodes, kind)
        with monkeypatch.context() as plainly:
            plainly.setattr(facet, "_INTEGRATED", facet._integrate)
            gone_through = gains(count, nodes, kind)
        for one, other in zip(frozen, gone_through, strict=True):
            assert np.isfinite(one).all()
            assert np.array_equal(one, other)


def test_threads_share_what_is_frozen():
    """Recorded by whichever comes first."""
    tasks = [(count, 3, kind, count) for count in (30, 31, 1000) for kind in KINDS] * 2
    alone = [gains(*task) for task in tasks]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda task: gains(*task), tasks))
    for one, other in zip(alone, together, strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_it_goes_through_its_kernel_once_for_each_kind():
    dr, types = drjit_types()
    gone_through = Mock()  # as a list it would be looked at as an input

    def multiplied(given, option):
        gone_through(option)
        lane = given["lanes"]
        value = dr.gather(types.Float64, given["numbers"], lane) * (2.0 if option else 3.0)
        dr.scatter(given["found"], value, lane)
        dr.eval(given["found"])

    kernel = Frozen(multiplied)
    for size in (5, 50, 3):
        for option in (True, False):
            numbers = upload(types.Float64, np.arange(size) + 1.0)
            found = dr.empty(types.Float64, size)
            kernel({"lanes": dr.arange(types.UInt32, size), "numbers": numbers, "found": found}, option)
            assert found.numpy().tolist() == [(2 if option else 3) * (k + 1.0) for k in range(size)]
    assert [each.args for each in gone_through.mock_calls] == [(True,), (False,)]


def test_garbage_waits_until_a_kernel_is_recorded():
    """A scene that is collected meanwhile would end the process."""
    collecting = []
    kernel = Frozen(lambda given: collecting.append(gc.isenabled()))
    dr, types = drjit_types()
    kernel({"found": dr.opaque(types.Float64, 1.0)})
    assert collecting == [False]
    assert gc.isenabled()

    def fails(given):
        raise RuntimeError("not today")

    with pytest.raises(RuntimeError):
        Frozen(fails)({"found": dr.opaque(types.Float64, 1.0)})
    assert gc.isenabled()


def test_nothing_is_an_error_and_not_the_end_of_the_process():
    dr, types = drjit_types()
    with pytest.raises(ValueError, match="'axes'"):
        Frozen(lambda given: None)({"media": [{"axes": dr.zeros(types.Float64, 0)}]})
