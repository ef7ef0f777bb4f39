"""Waves through slabs."""

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.scene.materials import material
from tests.reference.sbr.media import SlabOptics
from tests.reference.sbr.passage import Slab, SlabRoute, arriving_wave, polarised_field

NONE = np.zeros(1, np.int32)


def test_a_slab_leaves_its_coefficients():
    field = np.array([0, 0, 1.0])
    optics = SlabOptics.of([replace(material("plasterboard"), thickness=0.0125)], 77e9, 0.0)
    through = SlabRoute((), np.array([[3.0, 0, 0]]), ((Slab(np.array([[1.0, 0, 0]]), NONE),),))
    found = arriving_wave(np.zeros(3), through, optics)
    t_s, _ = optics.transmission(NONE, np.ones(1), 77e9)
    assert found.length[0] == pytest.approx(3.0 + optics.bulk(NONE, np.ones(1))[0])
    np.testing.assert_allclose(polarised_field(field, found, through, optics, 77e9)[0], [0, 0, t_s[0] / 3], atol=1e-12)
