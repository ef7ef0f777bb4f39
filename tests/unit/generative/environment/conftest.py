"""A model that is too small to draw anything, and views of boxes that it may learn from."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.generative.environment.layout_map import render_layout_map
from rfgen_sionna.generative.environment.place_encoder import ViewFacts
from rfgen_sionna.generative.environment.primitives import Primitives, PrimitiveScene
from rfgen_sionna.pir.codec import PirCodec
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import Pir
from training.environment.fits import fit_autoencoder
from training.environment.pir_data import PLACES
from training.environment.view_corpus import ViewCorpus


def a_wall(distance: float, view: View, level: float = -130.0, fading: bool = True) -> Pir:
    """A wall square to the x axis, and a floor at z = 0; levels [dB] are those at 3 m if they fade with range."""
    directions = view.directions
    with np.errstate(divide="ignore"):
        ahead = np.where(directions[..., 0] > 0, (distance - view.position[0]) / directions[..., 0], np.inf)
        below = np.where(directions[..., 2] < 0, -view.position[2] / directions[..., 2], np.inf)
    reach = np.minimum(ahead, below)
    there = np.isfinite(reach)
    fall = (3.0 / np.where(there, reach, 1.0)) ** 2 if fading else 1.0
    energy = np.where(there, 10 ** (level / 10) * fall, 0.0)
    arrival = np.where(there, 2 * reach / SPEED_OF_LIGHT, np.nan)
    return Pir(energy, arrival, np.zeros(reach.shape), view.fov_deg, view.position, view.orientation)


@pytest.fixture(scope="session")
def wall() -> Callable[..., Pir]:
    """Makes a view of a wall and a floor."""
    return a_wall


@pytest.fixture(scope="session")
def corpus() -> ViewCorpus:
    """Sixteen views of two places that differ in depth, and of each an incomplete one that is 6 dB weaker."""
    codec = PirCodec()
    rng = np.random.default_rng(3)
    images, weaker, views, layout_maps = [], [], [], []
    for k in range(16):
        facts = ViewFacts((60.0, 60.0), float(rng.uniform(0.8, 1.5)), float(rng.uniform(-0.1, 0.3)), 0.0)
        view = View((64, 64), facts.fov_deg, (0.0, 0.0, facts.height), (facts.yaw, facts.pitch, 0.0))
        distance = 3.0 + 3.0 * (k % 2) + float(rng.uniform(0, 0.5))
        pir = a_wall(distance, view)
        centre, half = [[0.0, 0.0, 0.0], [distance, 0.0, 0.0]], [[50.0, 50.0, 0.0], [0.0, 50.0, 50.0]]
        place = PrimitiveScene.plain(
            Primitives.upright(np.array(centre), np.array(half), np.zeros(2)), ("floor", "far wall"), 2
        )
        layout_maps.append(render_layout_map(place, view).channels(place, ("far wall",), codec))
        images.append(codec.encode(pir))
        weaker.append(codec.encode(a_wall(3.0, view, -136.0)))
        views.append(facts)
    return ViewCorpus(
        np.array(images, np.float16),
        np.arange(16, dtype=np.intp) % 2,
        PLACES,
        [["sofa"] if k % 2 == 0 else ["bed", "lamp"] for k in range(16)],
        [f"a {PLACES[k % 2]}" for k in range(16)],
        views,
        np.array(weaker, np.float16),
        np.array(layout_maps, np.float16),
    )


@pytest.fixture(scope="session")
def model(corpus: ViewCorpus) -> Any:
    """A model with random weights and its ControlNet."""
    import torch

    from rfgen_sionna.generative.environment.environment_model import EnvironmentModel, UNetShape, new_control
    from rfgen_sionna.generative.environment.place_encoder import PlaceEncoder

    torch.manual_seed(0)
    shape = UNetShape(channels=(16, 16, 32), latents=32, heads=2)
    unet = shape.unet().eval().requires_grad_(False)
    vae = fit_autoencoder(corpus.images.astype(np.float64), 32)
    text = PlaceEncoder(PLACES, corpus.things).eval().requires_grad_(False)
    control = new_control(unet).eval().requires_grad_(False)
    for parameter in control.controlnet_cond_embedding.conv_out.parameters():
        torch.nn.init.normal_(parameter, std=0.05)
    for block in (*control.controlnet_down_blocks, control.controlnet_mid_block):
        torch.nn.init.normal_(block.weight, std=0.05)
    return EnvironmentModel(unet, vae, text, PirCodec(), shape, {"seed": 0}, control=control)


@pytest.fixture(scope="session")
def model_folder(model: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its files."""
    from rfgen_sionna.generative.environment.environment_model import BASE_FILE, CONTROL_FILE
    from training.model_files import write_control, write_environment_model

    folder = tmp_path_factory.mktemp("model")
    write_environment_model(folder / BASE_FILE, model)
    write_control(folder / CONTROL_FILE, model.control, {})
    return folder


def _tokenizer(folder: Path) -> Any:
    """A CLIP tokenizer that spells."""
    from transformers import CLIPTokenizer

    letters = [chr(c) for c in range(ord("a"), ord("z") + 1)] + [",", "."]
    vocabulary = ["<|startoftext|>", "<|endoftext|>", *letters, *(f"{c}</w>" for c in letters)]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "vocab.json").write_text(json.dumps({w: i for i, w in enumerate(vocabulary)}), encoding="utf-8")
    (folder / "merges.txt").write_text("#version: 0.2\n", encoding="utf-8")
    return CLIPTokenizer(str(folder / "vocab.json"), str(folder / "merges.txt"), model_max_length=77)


def _text_model(projected: bool) -> Any:
    import torch
    from transformers import CLIPTextConfig, CLIPTextModel, CLIPTextModelWithProjection

    torch.manual_seed(1)
    config = CLIPTextConfig(
        vocab_size=64, hidden_size=32, intermediate_size=37, num_attention_heads=4, num_hidden_layers=2,
        projection_dim=32, bos_token_id=0, eos_token_id=1,
    )  # fmt: skip
    return (CLIPTextModelWithProjection if projected else CLIPTextModel)(config).eval()


@pytest.fixture(scope="session")
def stable_diffusion(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the architecture of Stable Diffusion 1.x, tiny, with random weights."""
    import torch
    from diffusers import AutoencoderKL, PNDMScheduler, StableDiffusionPipeline, UNet2DConditionModel

    folder = tmp_path_factory.mktemp("sd")
    torch.manual_seed(2)
    unet = UNet2DConditionModel(
        sample_size=32, in_channels=4, out_channels=4, block_out_channels=(8, 16), norm_num_groups=4,
        down_block_types=("DownBlock2D", "CrossAttnDownBlock2D"), up_block_types=("CrossAttnUpBlock2D", "UpBlock2D"),
        layers_per_block=1, cross_attention_dim=32, attention_head_dim=2,
    )  # fmt: skip
    vae = AutoencoderKL(
        block_out_channels=(8, 16), norm_num_groups=4, latent_channels=4, sample_size=64,
        down_block_types=("DownEncoderBlock2D",) * 2, up_block_types=("UpDecoderBlock2D",) * 2,
    )  # fmt: skip
    scheduler = PNDMScheduler(
        beta_schedule="scaled_linear", beta_start=0.00085, beta_end=0.012, skip_prk_steps=True, steps_offset=1
    )
    StableDiffusionPipeline(
        vae=vae, text_encoder=_text_model(False), tokenizer=_tokenizer(folder / "words"), unet=unet,
        scheduler=scheduler, safety_checker=None, feature_extractor=None, requires_safety_checker=False,
    ).save_pretrained(folder)  # fmt: skip
    return folder


@pytest.fixture(scope="session")
def stable_diffusion_xl(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the architecture of SDXL, tiny, with random weights."""
    import torch
    from diffusers import AutoencoderKL, EulerDiscreteScheduler, StableDiffusionXLPipeline, UNet2DConditionModel

    folder = tmp_path_factory.mktemp("sdxl")
    torch.manual_seed(2)
    unet = UNet2DConditionModel(
        sample_size=32, in_channels=4, out_channels=4, block_out_channels=(8, 16), norm_num_groups=4,
        down_block_types=("DownBlock2D", "CrossAttnDownBlock2D"), up_block_types=("CrossAttnUpBlock2D", "UpBlock2D"),
        layers_per_block=1, cross_attention_dim=64, attention_head_dim=2, addition_embed_type="text_time",
        addition_time_embed_dim=8, projection_class_embeddings_input_dim=32 + 6 * 8,
    )  # fmt: skip
    vae = AutoencoderKL(
        block_out_channels=(8, 16), norm_num_groups=4, latent_channels=4, sample_size=64,
        down_block_types=("DownEncoderBlock2D",) * 2, up_block_types=("UpDecoderBlock2D",) * 2,
    )  # fmt: skip
    words = _tokenizer(folder / "words")
    StableDiffusionXLPipeline(
        vae=vae, text_encoder=_text_model(False), text_encoder_2=_text_model(True), tokenizer=words, tokenizer_2=words,
        unet=unet, scheduler=EulerDiscreteScheduler(beta_schedule="scaled_linear"),
    ).save_pretrained(folder)  # fmt: skip
    return folder
