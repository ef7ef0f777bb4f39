"""The model under diffusers' interfaces, and its files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from rfgen_sionna.generative.environment.autoencoder import PatchAutoencoder
from rfgen_sionna.generative.environment.environment_model import (
    BASE_FILE,
    CONTROL_FILE,
    EnvironmentModel,
    ModelFileError,
    condition_of,
    read_model,
)
from rfgen_sionna.generative.environment.image_sampling import Conditioning, ImageSampler, noise_like, sample_images
from rfgen_sionna.generative.environment.path_diffusion import PathDiffusion
from rfgen_sionna.generative.environment.place_encoder import TOKENS, ViewFacts, view_tokens
from rfgen_sionna.generative.environment.torch_device import DeviceMemoryError
from rfgen_sionna.generative.environment.view_unet import make_scheduler
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import Pir
from training.environment.diffusers_pipelines import controlled, image_to_image, text_to_image
from training.environment.fits import fit_autoencoder
from training.environment.view_corpus import ViewCorpus, mirrored_facts

VIEW = ViewFacts((60.0, 60.0), 1.0, 0.1, 0.3)
STEPS = 3


def words(model: EnvironmentModel, text: str = "a bedroom") -> torch.Tensor:
    return model.text.embed([text], [VIEW])


def ours(model: EnvironmentModel, conditioning: Conditioning | None = None) -> np.ndarray:
    sampler = ImageSampler("ddim", STEPS, 2.0)
    return sample_images(
        model, make_scheduler(), sampler, words(model), words(model, ""), noise_like(1, model, 5), conditioning
    )


def settings(model: EnvironmentModel) -> dict[str, Any]:
    return {
        "prompt_embeds": words(model),
        "negative_prompt_embeds": words(model, ""),
        "num_inference_steps": STEPS,
        "guidance_scale": 2.0,
        "output_type": "np",
    }


def channels(pictures: np.ndarray) -> np.ndarray:
    return 2.0 * pictures.transpose(0, 3, 1, 2) - 1.0


def test_patches_are_kept_but_for_the_components_left_out(corpus: ViewCorpus) -> None:
    images = torch.from_numpy(corpus.images.astype(np.float32))
    whole, part = (fit_autoencoder(corpus.images.astype(np.float64), count) for count in (48, 8))
    assert torch.abs(whole(images).sample - images).max() < 1e-4
    latents = part.encode(images).latent_dist.mode()
    assert latents.shape == (16, 8, 16, 16)
    assert float(latents.square().mean()) == pytest.approx(1.0, abs=0.15)
    # the components that are kept are the largest: nothing else loses less
    assert torch.square(part(images).sample - images).mean() < 1e-3


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning")
def test_diffusers_own_pipelines_draw_what_we_draw(model: EnvironmentModel, corpus: ViewCorpus) -> None:
    noise = noise_like(1, model, 5)
    picture = text_to_image(model)(**settings(model), latents=noise, height=64, width=64).images
    assert np.abs(channels(picture) - ours(model)).max() < 1e-4
    condition = condition_of(corpus.images[:1])
    picture = controlled(model)(**settings(model), latents=noise, image=condition).images
    drawn = ours(model, Conditioning(control=condition))
    assert np.abs(channels(picture) - drawn).max() < 1e-4
    assert np.abs(drawn - ours(model)).max() > 1e-3, "the ControlNet has a say"
    picture = image_to_image(model)(**settings(model), image=condition, strength=0.7).images
    assert picture.shape == (1, 64, 64, 3)


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning")
def test_diffusers_own_pipelines_take_words(model: EnvironmentModel, corpus: ViewCorpus) -> None:
    """Strings, or lists of them, with negative ones, are what their embeddings are, for the view that is said."""
    noise = noise_like(2, model, 5)
    asked: dict[str, Any] = {"num_inference_steps": 2, "guidance_scale": 1.5, "output_type": "np", "latents": noise}
    prompts, negative = ["a lab with a stool", "a street"], ["a sink", ""]
    said = text_to_image(model, VIEW)(prompts, negative_prompt=negative, **asked).images
    told = {"prompt_embeds": prompts, "negative_prompt_embeds": negative}
    embedded = {name: model.text.embed(texts, [VIEW] * 2) for name, texts in told.items()}
    np.testing.assert_array_equal(said, text_to_image(model)(**embedded, **asked).images)
    assert np.abs(said - text_to_image(model)(prompts, negative_prompt=negative, **asked).images).max() > 1e-4
    asked = {"image": condition_of(corpus.images[:1]), "num_inference_steps": 2, "output_type": "np"}
    for pipeline in (controlled(model, VIEW), image_to_image(model, VIEW)):
        assert pipeline("a lab", **asked).images.shape == (1, 64, 64, 3)


def test_image_to_image_ends_at_the_image_and_known_patches_stay(model: EnvironmentModel, corpus: ViewCorpus) -> None:
    image = torch.from_numpy(corpus.images[:1].astype(np.float32))
    start = model.vae.encode(image).latent_dist.mode()
    kept = model.vae.decode(start).sample.clamp(-1, 1).numpy()
    assert np.abs(ours(model, Conditioning(start=start, strength=0.0)) - kept).max() < 1e-5
    keep = torch.zeros(1, 1, 16, 16, dtype=torch.bool)
    keep[..., :8] = True
    drawn = ours(model, Conditioning(known=start, keep=keep))
    assert np.abs(drawn - kept)[..., :32].max() < 1e-5
    assert np.abs(drawn - kept)[..., 32:].max() > 1e-2


@pytest.mark.parametrize("kind", ["dpm", "euler"])
def test_few_step_samplers_run(model: EnvironmentModel, kind: str) -> None:
    drawn = sample_images(
        model, make_scheduler(), ImageSampler(kind, 2, 1.0), words(model), words(model, ""), noise_like(1, model, 5)
    )
    assert np.isfinite(drawn).all()


def test_the_first_images_do_not_depend_on_how_many_are_drawn(model: EnvironmentModel) -> None:
    assert torch.equal(noise_like(1, model, 2)[0], noise_like(3, model, 2)[0])
    assert not torch.equal(noise_like(1, model, 2), noise_like(1, model, 3))


def test_what_a_view_is_reaches_the_model(model: EnvironmentModel) -> None:
    assert words(model).shape == (1, TOKENS, 128)
    first = view_tokens([VIEW])
    for other in (
        replace(VIEW, fov_deg=(65.0, 60.0)),
        replace(VIEW, height=1.2),
        replace(VIEW, pitch=0.2),
        replace(VIEW, yaw=0.6),
        replace(VIEW, roll=0.2),
    ):
        assert torch.abs(view_tokens([other]) - first).max() > 0.05
    assert mirrored_facts(mirrored_facts(VIEW)) == VIEW
    silent = model.text.embed([""], [VIEW])
    assert torch.equal(silent[:, :1], words(model)[:, :1])
    assert torch.count_nonzero(silent[:, 1:]) == 0


def test_running_out_of_memory_says_what_to_do(model: EnvironmentModel, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise torch.OutOfMemoryError("CUDA out of memory")

    monkeypatch.setattr(type(model.unet), "forward", full)
    with pytest.raises(DeviceMemoryError, match=r"device='cpu'"):
        ours(model)


@pytest.mark.filterwarnings("ignore::rfgen_sionna.generative.environment.image_models.UnknownPlaceWarning")
@pytest.mark.parametrize(("part", "method"), [(EnvironmentModel, "to"), (PatchAutoencoder, "encode")])
def test_so_it_does_while_a_model_moves_or_reads(
    model_folder: Path, wall: Callable[..., Pir], monkeypatch: pytest.MonkeyPatch, part: type, method: str
) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise torch.OutOfMemoryError("CUDA out of memory")

    view = View((64, 64), (60.0, 60.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    monkeypatch.setattr(part, method, full)
    with pytest.raises(DeviceMemoryError, match=r"device='cpu'"):
        PathDiffusion(model_folder).refine(wall(4.0, view), "a bedroom")


def test_files_of_other_kinds_are_refused(model_folder: Path, tmp_path: Path) -> None:
    with pytest.raises(ModelFileError, match=r"environment\.train makes one"):
        read_model(model_folder / CONTROL_FILE)
    with pytest.raises(ModelFileError, match=r"environment\.controlnet makes one"):
        read_model(model_folder, model_folder / BASE_FILE)
    (tmp_path / BASE_FILE).write_bytes(b"not a model at all, not a model")
    with pytest.raises(ModelFileError, match="no safetensors file"):
        read_model(tmp_path)
