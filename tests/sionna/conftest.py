"""What tests with Sionna's solvers need."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True)
def no_scene_ends_while_a_solver_looks() -> Iterator[None]:
    """Sionna's solvers ask all materials of the process what they reflect, those of scenes that nobody has any more
    among them. Scenes hold on to themselves until garbage is collected: if that is while a solver looks, the materials
    that it meets have lost their scene, and the solver fails or the process ends."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()
