"""The truths that the benchmark holds answers against."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rfgen_sionna.scene.rays import RayScene
from tests.benchmarks import keep_truth
from tests.benchmarks.stored import Store, identity, question
from tests.benchmarks.truth import Probe, Quadrature, _share_across, fresnel
from tests.reference.physical_optics import obliquity, po_gain

SQUARE = np.array([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1.0]])
FACES = np.array([[0, 2, 1], [0, 3, 2]], np.int32)
FIELD = np.array([0, 0, 1.0])
SKIN = 6.57 - 8.91j


def plate(permittivity: complex = complex(np.inf)) -> Quadrature:
    return Quadrature(0.05 * SQUARE + [1, 0.1, 0], FACES, np.zeros(3), 77e9, permittivity, FIELD, None)


@pytest.mark.parametrize("permittivity", [complex(np.inf), SKIN])
def test_the_obliquity_is_the_reference_s(permittivity: complex) -> None:
    rng = np.random.default_rng(0)
    normal, towards = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in rng.normal(size=(2, 200, 3)))
    normal = np.where((normal * towards).sum(axis=1, keepdims=True) > 0, -normal, normal)
    e = FIELD - (towards @ FIELD)[:, None] * towards
    e /= np.linalg.norm(e, axis=1, keepdims=True)
    expected = obliquity(normal, towards, e, -towards, e, permittivity, 1.0)[:, 0]
    cos = -(normal * towards).sum(axis=1)
    r_s, r_p = fresnel(permittivity, 1.0, cos)
    across = _share_across(towards, normal, FIELD)
    np.testing.assert_allclose(cos * (r_s * across - r_p * (1 - across)), expected, atol=1e-12)


@pytest.mark.parametrize("permittivity", [complex(np.inf), SKIN])
def test_the_integral_of_a_plate_is_the_reference_s(permittivity: complex) -> None:
    found = plate(permittivity)
    shift = np.array([0.01, 0.002, 0.0])
    gains = found.sums([Probe.channel(np.zeros(3), 77e9), Probe.channel(shift, 77e9)])
    for gain, offset in zip(gains, (np.zeros(3), shift), strict=True):
        corners = (found.vertices + offset)[found.faces]
        expected = po_gain(corners, np.zeros(3), np.zeros(3), FIELD, FIELD, 77e9, permittivity, n=120)
        assert abs(gain - expected) < 1e-9 * abs(expected)


def test_hidden_points_do_not_count() -> None:
    """Two squares one behind the other: of the farther one, which is twice as wide, a quarter is hidden."""
    vertices = np.concatenate([0.1 * SQUARE + [2, 0, 0], 0.4 * SQUARE + [4, 0, 0]])
    faces = np.concatenate([FACES, FACES + 4])
    scene = RayScene([], [(vertices, faces)], origin=np.zeros(3))
    for rays, farther in ((None, 0.64), (lambda: scene, 0.48)):
        pieces = list(Quadrature(vertices, faces, np.zeros(3), 77e9, complex(np.inf), FIELD, rays).pieces())
        points, area = (np.concatenate([getattr(each, name) for each in pieces]) for name in ("points", "area"))
        assert area[points[:, 0] < 3].sum() == pytest.approx(0.04)
        assert area[points[:, 0] > 3].sum() == pytest.approx(farther, rel=0.01)


def test_answers_are_kept_by_all_that_they_depend_on(tmp_path: Path) -> None:
    found, probe = plate(), [Probe.channel(np.zeros(3), 77e9)]
    path = tmp_path / "truth.json"
    store = Store(path, shipped=None)
    value = store.sums(found, probe)
    assert store.integrated == 1
    assert len(json.loads(path.read_text(encoding="utf-8"))) == 1
    again = Store(path, shipped=None)
    assert again.sums(found, probe) == value
    assert again.integrated == 0
    again.sums(replace(found, vertices=found.vertices + 1e-12), probe)  # rounding is none of the body's
    assert again.integrated == 0
    others = [
        replace(found, vertices=found.vertices + 1e-5), replace(found, faces=FACES[:1]), replace(found, frequency=76e9),
        replace(found, permittivity=SKIN), replace(found, oversampling=0.7), replace(found, field=np.eye(3)[1]),
    ]  # fmt: skip
    assert len({identity(each) for each in (found, *others)}) == 7
    assert identity(found) != identity(found, [(found.vertices, FACES)])
    bent = Probe((0, 0, 0), probe[0].linear, 1.0)
    moved = Probe((1e-9, 0, 0), probe[0].linear)
    assert len({question(each) for each in (*probe, bent, moved, replace(bent, permittivity=SKIN))}) == 4


def test_what_is_kept_is_what_would_be_found() -> None:
    """Of what is quick to integrate; all of it: `python -m tests.benchmarks.keep_truth --check`."""
    for name, difference in keep_truth.differences(["plate"]).items():
        assert difference < keep_truth.AGREE, name
