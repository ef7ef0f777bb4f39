"""diffusers' own pipelines on the environment model, for comparison with the package's sampler."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, ClassVar

import torch
from torch import Tensor, nn

from rfgen_sionna.generative.environment.environment_model import EnvironmentModel, ModelFileError
from rfgen_sionna.generative.environment.place_encoder import PlaceEncoder, ViewFacts
from rfgen_sionna.generative.environment.sentence_encoder import MAX_WORDS, tokenise, words
from rfgen_sionna.generative.environment.view_unet import make_scheduler

if TYPE_CHECKING:
    from diffusers import (
        StableDiffusionControlNetPipeline,
        StableDiffusionImg2ImgPipeline,
        StableDiffusionPipeline,
    )

HORIZONTAL_VIEW = ViewFacts((60.0, 60.0), 1.0, 0.0, 0.0)
"""Default view of a prompt: level, 1 m above the floor."""


class PromptTokenizer:
    """diffusers' interface of a tokenizer: sentences to buckets of pieces of words."""

    model_max_length = MAX_WORDS
    added_tokens_encoder: ClassVar[dict[str, int]] = {}
    """Words of textual inversions: none."""

    def tokenize(self, text: str) -> list[str]:
        """Words of a text."""
        return words(text)

    def __call__(self, texts: str | Sequence[str], **_: Any) -> SimpleNamespace:
        """`input_ids` (text, word, piece) and their mask; options of padding are ignored."""
        ids = tokenise([texts] if isinstance(texts, str) else list(texts))
        return SimpleNamespace(input_ids=ids, attention_mask=(ids > 0).any(dim=-1))


class PromptEncoder(nn.Module):
    """diffusers' interface of a text encoder, for one view.

    Args:
        text: the model's encoder.
        view: of all prompts.
    """

    def __init__(self, text: PlaceEncoder, view: ViewFacts = HORIZONTAL_VIEW) -> None:
        super().__init__()
        self.text, self.view = text, view
        self.config = SimpleNamespace(use_attention_mask=False)

    @property
    def dtype(self) -> torch.dtype:
        return self.text.named.weight.dtype

    @property
    def device(self) -> torch.device:
        return self.text.named.weight.device

    def forward(self, ids: Tensor, attention_mask: Tensor | None = None) -> tuple[Tensor]:
        """((text, TOKENS, WIDTH),) of `input_ids`."""
        said = (ids > 0).any(dim=-1).any(dim=-1)
        return (self.text.embed_ids(ids, said, [self.view] * len(ids)),)


def text_to_image(model: EnvironmentModel, view: ViewFacts = HORIZONTAL_VIEW) -> StableDiffusionPipeline:
    """Text-to-image pipeline, without layout maps; prompts are strings for `view`, or `prompt_embeds` of
    :meth:`PlaceEncoder.embed` for views of their own."""
    from diffusers import StableDiffusionPipeline

    return _quiet(StableDiffusionPipeline(**_parts(model, view)))


def image_to_image(model: EnvironmentModel, view: ViewFacts = HORIZONTAL_VIEW) -> StableDiffusionImg2ImgPipeline:
    """Image-to-image pipeline."""
    from diffusers import StableDiffusionImg2ImgPipeline

    return _quiet(StableDiffusionImg2ImgPipeline(**_parts(model, view)))


def controlled(model: EnvironmentModel, view: ViewFacts = HORIZONTAL_VIEW) -> StableDiffusionControlNetPipeline:
    """ControlNet pipeline.

    Raises:
        ModelFileError: the model has no ControlNet.
    """
    if model.control is None:
        raise ModelFileError("control: the model has no ControlNet; train one with training.environment.controlnet")
    from diffusers import StableDiffusionControlNetPipeline

    return _quiet(StableDiffusionControlNetPipeline(**_parts(model, view), controlnet=model.control))


def _parts(model: EnvironmentModel, view: ViewFacts) -> dict[str, Any]:
    return {
        "vae": model.vae,
        "text_encoder": PromptEncoder(model.text, view),
        "tokenizer": PromptTokenizer(),
        "unet": model.unet,
        "scheduler": make_scheduler(),
        "safety_checker": None,
        "feature_extractor": None,
        "requires_safety_checker": False,
    }


def _quiet(pipeline: Any) -> Any:
    pipeline.set_progress_bar_config(disable=True)
    return pipeline
