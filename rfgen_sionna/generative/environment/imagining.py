"""Images of surroundings from tokens: from a draft to a finished picture, as all that draws does it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from rfgen_sionna.generative.environment.drafts import settled
from rfgen_sionna.generative.environment.model import EnvironmentModel
from rfgen_sionna.generative.environment.sampling import Guide, Sampler, draw
from rfgen_sionna.generative.environment.text import ViewFacts
from rfgen_sionna.generative.environment.views import PATCH
from rfgen_sionna.records import FloatArray

FROM_DRAFT = 0.85
"""How much of the schedule is run from a draft; 1 is from noise alone."""


@dataclass(frozen=True)
class Wish:
    """One image that is wanted."""

    place: int
    """Index of the place."""
    facts: ViewFacts
    seed: int
    first: ViewFacts | None = None
    """How the place was seen first, where this is another view of it."""
    moved: tuple[float, float] = (0.0, 0.0)
    """From there to here [m]."""


def imagine(
    model: EnvironmentModel,
    scheduler: Any,
    sampler: Sampler,
    wishes: Sequence[Wish],
    tokens: Tensor,
    against: Tensor,
    noise: Tensor,
    guide: Guide | None = None,
    *,
    from_draft: float = FROM_DRAFT,
    progress: Callable[[int, int], None] | None = None,
) -> FloatArray:
    """(image, 3, row, column) finished images; the arguments are those of :func:`draw`.

    Where the model has drafts, drawing starts from one for each of `wishes` with `from_draft` of the schedule to go.
    """
    guide = guide or Guide()
    drafts = model.drafts
    if drafts is None or from_draft >= 1.0:
        drawn = draw(model, scheduler, sampler, tokens, against, noise, guide, progress)
        finished = model.polish(drawn)
    else:
        boxes = np.stack(
            [drafts.draw(w.place, w.facts, model.codec, w.seed, first=w.first, moved=w.moved) for w in wishes]
        )
        with torch.no_grad():
            start = model.vae.encode(torch.from_numpy(boxes).to(model.vae.device)).latent_dist.mode()
        guide = replace(guide, start=start.float(), strength=from_draft)
        drawn = draw(model, scheduler, sampler, tokens, against, noise, guide, progress)
        finished = model.polish(settled(drawn, boxes))
    if guide.keep is None:
        return finished
    known = np.kron(guide.keep.cpu().numpy(), np.ones((1, 1, PATCH, PATCH))) > 0
    return np.where(known, drawn, finished)
