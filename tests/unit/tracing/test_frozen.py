"""Kernels that Python goes through once return what they would if it did so each time."""

import gc
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from unittest.mock import Mock

import numpy as np
import pytest
import trimesh

from rfgen_sionna.scene.kernels import FrozenKernel, drjit_types, exact_division, upload
from rfgen_sionna.tracing.integral import facet
from rfgen_sionna.tracing.integral.facet import Nodes, facet_gains, split_by_curvature
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.integral.quadratic import SlopeOrder
from rfgen_sionna.tracing.surface import facet_positions as placing
from rfgen_sionna.tracing.surface.facet_positions import place_facets
from rfgen_sionna.tracing.surface.quadratic_patch import QuadraticPatch
from rfgen_sionna.tracing.surface.tessellate import Tessellation

ACROSS = np.array([0.0, 0.0, 1.0])


def quotients(given):
    """The kernel of :func:`test_quotients_are_of_double_precision`."""
    dr, _ = drjit_types()
    one, many = 1.0 / given["x"], given["y"] / given["x"]
    for each, name in ((one, "one"), (many, "many"), (dr.rsqrt(given["x"]), "root")):
        dr.scatter(given[name], each, given["lanes"])
    dr.eval(given["one"], given["many"], given["root"])


def test_quotients_are_of_double_precision():
    """On whichever device, however fast its arithmetic."""
    dr, types = drjit_types()
    x, y = np.random.default_rng(0).uniform(0.1, 10.0, (2, 1000))
    found = {name: dr.empty(types.Float64, len(x)) for name in ("one", "many", "root")}
    lanes = dr.arange(types.UInt32, len(x))
    FrozenKernel(quotients)({"lanes": lanes, "x": upload(types.Float64, x), "y": upload(types.Float64, y), **found})
    for name, expected in (("one", 1 / x), ("many", y / x), ("root", 1 / np.sqrt(x))):
        np.testing.assert_allclose(found[name].numpy(), expected, rtol=5e-16)


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
    sagittas, corner_offsets = rng.normal(size=(2, count, 3, 3)) * 1e-4
    parts, middle = rng.integers(1, 4, count), corners.mean(axis=1)
    index = rng.integers(0, 2, count).astype(np.int32)
    if kind == "mixed":  # the flat first, then the bent ones among them

        def of(some, bent, buffer):
            patch = QuadraticPatch(sagittas[some], None) if bent else None
            known = corners[some], index[some], media(nodes, 2), at, ACROSS, ACROSS, parts[some]
            return facet_gains(*known, True, patch=patch, reference=middle[some], buffer=buffer)

        found = split_by_curvature(rng.random(count) < 0.5, of)
    else:
        options = {
            "plain": {},
            "slabs": {"axes": np.eye(3)[:2], "monostatic": True},
            "two places": {"origin": np.array([0.1, 0, 0]), "reference": middle},
            "parts": {"parts": parts, "reference": middle, "axes": np.eye(3)[:2]},
            "no axes": {"axes": np.zeros((0, 3)), "monostatic": True},
            "bent": {
                "parts": parts,
                "patch": QuadraticPatch(sagittas, corner_offsets),
                "axes": np.eye(3)[1:2],
                "monostatic": True,
            },
            "together": {"parts": parts, "axes": np.eye(3)[:2], "kinds": SlopeOrder.FIRST, "steady": True},
            "bent together": {
                "patch": QuadraticPatch(sagittas, corner_offsets),
                "axes": np.eye(3)[:2],
                "kinds": SlopeOrder.CURVATURE,
                "steady": True,
            },
            "antennas": {
                "pattern_gradient": rng.normal(size=(count, 3)),
                "gradient_origin": middle,
                "monostatic": True,
            },
        }
        of_slabs = media(nodes, 2, 0.01) if kind in ("plain", "slabs") else media(nodes, 2)
        found = facet_gains(corners, index, of_slabs, at, ACROSS, ACROSS, **options[kind])
    return found.terms.copy(), found.tau.copy()


KINDS = (
    "plain", "slabs", "two places", "parts", "no axes", "bent", "together", "bent together", "antennas", "mixed",
)  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("nodes", [1, 3])
def test_what_is_frozen_is_the_kernel_itself_to_the_bit(monkeypatch, kind, nodes):
    """Of many facets and of few, one after the other: what is kept of one size serves all."""
    for count in (40, 3000, 7, 1, 2, 41):
        frozen = gains(count, nodes, kind)
        with monkeypatch.context() as plainly:
            plainly.setattr(facet, "_INTEGRATED", exact_division()(facet._integrate))
            gone_through = gains(count, nodes, kind)
        for one, other in zip(frozen, gone_through, strict=True):
            assert np.isfinite(one).all()
            assert np.array_equal(one, other)


def test_threads_share_what_is_frozen(monkeypatch):
    """Whichever comes first records a kernel, while garbage is collected as often as may be."""
    mesh = trimesh.creation.icosphere(subdivisions=2)
    faces, eye = mesh.faces.astype(np.int32), np.broadcast_to(np.eye(3), (len(mesh.faces), 3, 3))
    piece = Tessellation(np.arange(len(faces), dtype=np.int32), eye, np.ones(len(faces), np.int32))

    def of(count, kind):
        if kind != "placed":
            return gains(count, 3, kind, count)
        return place_facets(piece, faces, [np.asarray(mesh.vertices)] * (1 + count % 3), np.zeros(3), 1600.0)[:3]

    tasks = [(count, kind) for count in (30, 31, 1000) for kind in (*KINDS, "placed")]
    alone = [of(*task) for task in tasks]
    monkeypatch.setattr(facet, "_INTEGRATED", FrozenKernel(facet._integrate))
    monkeypatch.setattr(placing, "_PLACED", FrozenKernel(placing._place))
    reference_level = gc.get_threshold()
    gc.set_threshold(10, 2, 2)
    try:
        with ThreadPoolExecutor(4) as pool:
            together = list(pool.map(lambda task: of(*task), tasks))
    finally:
        gc.set_threshold(*reference_level)
    for one, other in zip(alone, together, strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_it_goes_through_its_kernel_once_for_each_kind():
    dr, types = drjit_types()
    gone_through = Mock()

    def multiplied(given, option):
        gone_through(option)
        lane = given["lanes"]
        value = dr.gather(types.Float64, given["numbers"], lane) * (2.0 if option else 3.0)
        dr.scatter(given["found"], value, lane)
        dr.eval(given["found"])

    kernel = FrozenKernel(multiplied)
    for size in (5, 50, 3):
        for option in (True, False):
            numbers = upload(types.Float64, np.arange(size) + 1.0)
            found = dr.empty(types.Float64, size)
            kernel({"lanes": dr.arange(types.UInt32, size), "numbers": numbers, "found": found}, option)
            assert found.numpy().tolist() == [(2 if option else 3) * (k + 1.0) for k in range(size)]
    assert [each.args for each in gone_through.mock_calls] == [(True,), (False,)]


def test_options_are_told_apart_whichever_of_them_are_equal():
    """Dr.Jit by itself replays for (2, 1, 1) what it recorded for (2, 1, 2): an object met before is the same to it."""
    dr, types = drjit_types()

    def written(given, *options):
        number = sum(int(option) * 10**k for k, option in enumerate(options))
        dr.scatter(given["found"], types.Float64(number), given["lanes"])
        dr.eval(given["found"])

    kernel = FrozenKernel(written)
    for options in product((False, True), (0, 1, 2), (0, 1, 2), (0, 1, 2)):
        found = dr.zeros(types.Float64, 3)
        kernel({"lanes": dr.arange(types.UInt32, 3), "found": found}, *options)
        assert found.numpy().tolist() == 3 * [sum(int(option) * 10**k for k, option in enumerate(options))]


def test_garbage_waits_until_a_kernel_is_recorded():
    """A scene that is collected meanwhile would end the process."""
    collecting = []
    kernel = FrozenKernel(lambda given: collecting.append(gc.isenabled()))
    dr, types = drjit_types()
    kernel({"found": dr.opaque(types.Float64, 1.0)})
    assert collecting == [False]
    assert gc.isenabled()

    def fails(given):
        raise RuntimeError("not today")

    with pytest.raises(RuntimeError):
        FrozenKernel(fails)({"found": dr.opaque(types.Float64, 1.0)})
    assert gc.isenabled()


def test_nothing_is_an_error_and_not_the_end_of_the_process():
    dr, types = drjit_types()
    with pytest.raises(ValueError, match="'axes'"):
        FrozenKernel(lambda given: None)({"media": [{"axes": dr.zeros(types.Float64, 0)}]})


def test_what_would_be_taken_for_something_else_is_refused():
    """An array twice, and what is no array: Dr.Jit tells neither from others of its kind."""
    dr, types = drjit_types()
    one = dr.zeros(types.Float64, 1)
    with pytest.raises(ValueError, match="'second'"):
        FrozenKernel(lambda given: None)({"first": one, "second": one})
    with pytest.raises(TypeError, match="'count'"):
        FrozenKernel(lambda given: None)({"first": one, "count": 2})


def test_an_option_that_would_let_another_thread_in_is_refused():
    dr, types = drjit_types()
    with pytest.raises(TypeError, match="SlopeOrder"):
        FrozenKernel(lambda given, kinds: None)({"one": dr.zeros(types.Float64, 1)}, SlopeOrder.FIRST)
