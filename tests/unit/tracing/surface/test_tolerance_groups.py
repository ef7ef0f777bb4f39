"""Tolerance groups: errors relative to the return of all their surfaces."""

from types import SimpleNamespace

import numpy as np
import pytest

from rfgen_sionna.tracing.gains.error_estimate import ErrorEstimate, combine_groups
from rfgen_sionna.tracing.surface.surfaces import tolerance_groups


def test_one_group_per_actor_and_one_for_static_surfaces():
    surfaces = [SimpleNamespace(still=still) for still in (False, True, True, False, True)]
    assert tolerance_groups(surfaces).tolist() == [0, 1, 1, 3, 1]
    assert tolerance_groups(surfaces[:1]).tolist() == [0]
    assert tolerance_groups([]).tolist() == []


def test_a_weak_surface_has_the_level_of_its_group():
    """Each surface errs by 0.1 % of the stronger one: together by 0.14 % of the sum. An actor keeps its own error."""
    found = ErrorEstimate(
        amount=np.array([2e-3, 1e-3, 1e-3]),
        level=np.array([0.1, 1.0, 1e-4]),
        least=np.array([0.0, 0.0, 0.0]),
        incoherent=np.array([0.3, 0.9, 1e-2]),
    )
    assert found.error == pytest.approx([2e-2, 1e-3, 10.0])
    shared = combine_groups(found, np.array([0, 1, 1]))
    assert shared.error == pytest.approx([2e-2, np.sqrt(2) * 1e-3, np.sqrt(2) * 1e-3])
    assert shared.cancellation == pytest.approx([3.0, np.hypot(0.9, 1e-2), np.hypot(0.9, 1e-2)])
    assert combine_groups(found, np.arange(3)).error == pytest.approx(found.error)
