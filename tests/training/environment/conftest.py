"""The small models and views of the image models' own tests."""

from __future__ import annotations

from tests.unit.generative.environment.conftest import (
    corpus,
    model,
    model_folder,
    stable_diffusion,
    stable_diffusion_xl,
    wall,
)

__all__ = ["corpus", "model", "model_folder", "stable_diffusion", "stable_diffusion_xl", "wall"]
