"""RF LoRA: base, LoRA, ControlNet one after another; Stable Diffusion's architecture; what belongs to another base."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from rfgen_sionna.generative.environment.adapters import WEIGHT_NAME, LoraError, find_lora, read_facts
from rfgen_sionna.generative.environment.environment_diffusion import EnvironmentDiffusion
from rfgen_sionna.generative.environment.environment_model import BASE_FILE, CONTROL_FILE, UNetShape
from rfgen_sionna.generative.environment.image_models import load_embedded
from rfgen_sionna.generative.environment.path_diffusion import PathDiffusion
from training.environment.lora_bases import EmbeddedBase, StableDiffusionBase
from training.environment.lora_training import LoraRecipe, _spread_steps, choose_rate, train_lora
from training.environment.view_corpus import ViewCorpus
from training.model_files import write_environment_model

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning", "ignore::FutureWarning", "ignore::DeprecationWarning")
SHORT = LoraRecipe(frames=8, steps=3, items=4)


@pytest.fixture(scope="module")
def lora(corpus: ViewCorpus, model_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A LoRA of the embedded model, three steps old."""
    out = tmp_path_factory.mktemp("lora")
    outcome = choose_rate(lambda: EmbeddedBase(model_folder, "cpu"), corpus, corpus, out, SHORT, [0.05, 1e-6])
    assert set(outcome.losses) == {0.05, 1e-6}
    assert outcome.losses[outcome.rate] == min(outcome.losses.values())
    choose_rate(lambda: EmbeddedBase(model_folder, "cpu"), corpus, corpus, out / "strong", SHORT, [0.05])
    return out / "strong" / WEIGHT_NAME


@pytest.mark.slow
def test_a_lora_changes_what_is_drawn_and_only_that_model(lora: Path, model_folder: Path) -> None:
    plain, adapted = (EnvironmentDiffusion(model_folder, each, steps=2) for each in (None, lora))
    a, b = (each.generate("a bedroom", seed=1) for each in (plain, adapted))
    assert not np.array_equal(a.energy, b.energy)
    again = EnvironmentDiffusion(model_folder, lora, steps=2).generate("a bedroom", seed=1)
    np.testing.assert_array_equal(again.energy, b.energy)


@pytest.mark.parametrize("convolutions", [False, True])
def test_what_was_trained_is_what_is_read(
    corpus: ViewCorpus, model_folder: Path, tmp_path: Path, convolutions: bool
) -> None:
    """Every layer of it: the network that was trained, and the base with the file merged into it, guess the same."""
    import torch

    trained = EmbeddedBase(model_folder, "cpu")
    recipe = LoraRecipe(frames=8, steps=4, items=2, convolutions=convolutions)
    choose_rate(lambda: trained, corpus, corpus, tmp_path, recipe, [0.05])
    plain, merged = (load_embedded(model_folder, each, "cpu").unet for each in (None, tmp_path))
    torch.manual_seed(0)
    latents, times = torch.randn(2, plain.config.in_channels, 16, 16), torch.tensor([300, 800])
    words = trained.words(["a bedroom", "a street"], corpus.views[:2])
    with torch.no_grad():
        wanted, read, before = (net(latents, times, **words).sample for net in (trained.unet, merged, plain))
    change = (wanted - before).norm()
    assert change > 0.05 * before.norm()
    assert (read - wanted).norm() < 0.01 * change  # half precision of the file
    layers = {k for k, v in merged.state_dict().items() if not torch.equal(v, plain.state_dict()[k])}
    assert any("attn" in k for k in layers)
    assert any("conv" in k for k in layers) is convolutions


def test_a_file_that_mixes_names_is_refused(lora: Path, model_folder: Path, tmp_path: Path) -> None:
    """As files with convolutions were written once: attention under diffusers' old names, which would be lost."""
    from safetensors.torch import load_file, save_file

    state = load_file(lora)
    first = next(key for key in state if "to_q" in key).split(".lora_")[0]
    old = {k.replace(".lora_A.", ".lora.down.").replace(".lora_B.", ".lora.up.") if k.startswith(first) else k: v
           for k, v in state.items()}  # fmt: skip
    save_file(old, tmp_path / "mixed.safetensors")
    with pytest.raises(LoraError, match="mixes old and new names"):
        EnvironmentDiffusion(model_folder, tmp_path / "mixed.safetensors")


def test_base_then_lora_then_control_net(lora: Path, model_folder: Path, corpus: ViewCorpus) -> None:
    adapted, plain = (PathDiffusion(model_folder, lora=each, steps=2, samples=1) for each in (lora, None))
    mixed = EnvironmentDiffusion(model_folder, lora, steps=2).generate("a bedroom", seed=1)
    a, b = (each.refine(mixed, "a bedroom", seed=2) for each in (adapted, plain))
    assert not np.array_equal(a.energy, b.energy)
    assert not np.array_equal(a.energy, mixed.energy)


def test_training_goes_on_where_it_was_stopped(corpus: ViewCorpus, model_folder: Path, tmp_path: Path) -> None:
    def train(out: Path, steps: int) -> dict[str, Any]:
        recipe = LoraRecipe(frames=8, steps=steps, items=2, save_every=2)
        return train_lora(EmbeddedBase(model_folder, "cpu"), corpus, out, recipe, 1e-3)[0]

    train(tmp_path / "stopped", 2)
    stopped, whole = train(tmp_path / "stopped", 4), train(tmp_path / "whole", 4)
    assert stopped.keys() == whole.keys()
    for key, values in stopped.items():
        np.testing.assert_array_equal(values.numpy(), whole[key].numpy())


def test_a_lora_of_another_base_is_refused(lora: Path, model: Any, corpus: ViewCorpus, tmp_path: Path) -> None:
    shape = UNetShape(channels=(16, 32, 32), latents=32, heads=2)
    write_environment_model(tmp_path / BASE_FILE, replace(model, unet=shape.unet(), shape=shape))
    with pytest.raises(LoraError, match=r"another base.*own base"):
        EnvironmentDiffusion(tmp_path, lora)


def test_a_lora_of_other_weights_is_refused(lora: Path, model: Any, tmp_path: Path) -> None:
    """Of the same shape, and of no use there."""
    import torch

    torch.manual_seed(5)
    write_environment_model(tmp_path / BASE_FILE, replace(model, unet=model.shape.unet()))
    with pytest.raises(LoraError, match=r"weights of 'model\d*' differ.*own base"):
        EnvironmentDiffusion(tmp_path, lora)


def test_a_lora_that_is_broken_is_refused(lora: Path, model_folder: Path, tmp_path: Path) -> None:
    from safetensors.torch import load_file, save_file

    state = load_file(lora)
    up = next(key for key in state if ".lora_B." in key)
    for broken, match in (
        ({k: v for k, v in state.items() if k != up}, "incomplete"),
        ({**state, up: state[up][:-1].contiguous()}, "another base"),
        ({**state, up: state[up] * np.nan}, "not finite"),
    ):
        save_file(broken, tmp_path / "broken.safetensors")
        with pytest.raises(LoraError, match=match):
            EnvironmentDiffusion(model_folder, tmp_path / "broken.safetensors")


def test_a_lora_s_word_is_said(corpus: ViewCorpus, model_folder: Path, tmp_path: Path) -> None:
    for word in ("", "rfpir"):
        recipe = LoraRecipe(frames=8, steps=1, items=2, word=word)
        choose_rate(lambda: EmbeddedBase(model_folder, "cpu"), corpus, corpus, tmp_path / word, recipe, [1e-9])
    own = [EnvironmentDiffusion(model_folder, tmp_path / word, steps=2, use_layout_map=False) for word in ("", "rfpir")]
    silent, said = (each.generate("a bedroom", seed=1) for each in own)
    assert not np.array_equal(silent.energy, said.energy)
    np.testing.assert_array_equal(own[0].generate("rfpir a bedroom", seed=1).energy, said.energy)


@pytest.mark.slow
def test_a_rate_that_leads_astray_is_not_chosen(corpus: ViewCorpus, model_folder: Path, tmp_path: Path) -> None:
    recipe = LoraRecipe(frames=8, steps=3, items=2)
    learn = corpus
    bad = replace(corpus, images=np.full_like(corpus.images, np.nan))
    with pytest.raises(ValueError, match=r"rate: \[0\.001\].*lower ones"):
        choose_rate(lambda: EmbeddedBase(model_folder, "cpu"), bad, corpus, tmp_path / "bad", recipe, [1e-3])
    assert not (tmp_path / "bad" / WEIGHT_NAME).exists()
    found = choose_rate(lambda: EmbeddedBase(model_folder, "cpu"), learn, corpus, tmp_path, recipe, [0.9, 1e-4])
    assert found.losses[found.rate] == np.nanmin(list(found.losses.values()))
    assert read_facts(tmp_path / WEIGHT_NAME).rate == found.rate


def test_training_does_not_go_on_with_another_base(
    model: Any, corpus: ViewCorpus, model_folder: Path, tmp_path: Path
) -> None:
    import torch

    recipe = LoraRecipe(frames=8, steps=1, items=2)
    train_lora(EmbeddedBase(model_folder, "cpu"), corpus, tmp_path / "out", recipe, 1e-3)
    torch.manual_seed(5)
    other = tmp_path / model_folder.name
    other.mkdir()
    write_environment_model(other / BASE_FILE, replace(model, unet=model.shape.unet()))
    with pytest.raises(ValueError, match="use another folder"):
        train_lora(EmbeddedBase(other, "cpu"), corpus, tmp_path / "out", recipe, 1e-3)


def test_a_lora_that_is_not_there_is_told(tmp_path: Path, lora: Path) -> None:
    with pytest.raises(LoraError, match="no file, no folder"):
        find_lora(tmp_path / "none.safetensors")
    with pytest.raises(LoraError, match=r"holds 0 \.safetensors"):
        find_lora(tmp_path)
    (tmp_path / "weights.bin").write_bytes(b"x")
    with pytest.raises(LoraError, match="may run code"):
        find_lora(tmp_path / "weights.bin")
    assert find_lora(lora.parent) == lora


def test_the_paper_is_the_preset_and_two_per_cent_are_trained() -> None:
    from training.environment.lora_training import add_lora

    assert (LoraRecipe.frames, LoraRecipe.steps, LoraRecipe.paper_rate) == (800, 100, 1e-4)
    unet = UNetShape().unet()
    everything = sum(p.numel() for p in unet.parameters())
    assert sum(p.numel() for p in add_lora(unet, LoraRecipe.rank)) < 0.02 * everything


@pytest.mark.parametrize("kind", ["stable_diffusion", "stable_diffusion_xl"])
def test_one_step_saving_and_loading_on_stable_diffusion(
    kind: str, corpus: ViewCorpus, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    import torch

    from rfgen_sionna.generative.environment.stable_diffusion import load_lora_into, load_pipeline

    folder = request.getfixturevalue(kind)
    recipe = LoraRecipe(frames=4, steps=1, items=1, text_encoder=True, word="rfpir")
    outcome = choose_rate(lambda: StableDiffusionBase(str(folder), "cpu"), corpus, corpus, tmp_path, recipe, [0.05])
    assert outcome.state
    assert any(key.startswith("text_encoder.") for key in outcome.state)
    facts = read_facts(tmp_path / WEIGHT_NAME)
    assert (facts.codec, facts.word, facts.steps) == ("rfgen", "rfpir", 1)
    plain, adapted = (EnvironmentDiffusion(folder, each, steps=2) for each in (None, tmp_path))
    pipeline = load_pipeline(str(folder), torch.float32)
    before = {name: values.clone() for name, values in pipeline.text_encoder.state_dict().items()}
    load_lora_into(pipeline, tmp_path)
    after = pipeline.text_encoder.state_dict()
    assert any(not torch.equal(after[name], values) for name, values in before.items()), "the text encoder's half"
    a, b = (each.generate("a bedroom", seed=1) for each in (plain, adapted))
    assert a.energy.shape == (64, 64)
    assert not np.array_equal(a.time_of_arrival, b.time_of_arrival, equal_nan=True)
    turned = adapted.generate("a bedroom", seed=1, orientation=(0.2, 0.0, 0.0))
    assert np.isfinite(turned.energy).all()


def test_released_loras_draw_in_the_authors_convention(stable_diffusion: Path, tmp_path: Path) -> None:
    import torch
    from safetensors.torch import save_file

    from rfgen_sionna._types import SPEED_OF_LIGHT
    from rfgen_sionna.generative.environment.stable_diffusion import load_pipeline
    from training.environment.lora_training import add_lora, lora_state

    pipeline = load_pipeline(str(stable_diffusion), torch.float32)
    add_lora(pipeline.unet, 2)
    state = {k.replace("unet.", "lora_unet_"): v for k, v in lora_state(pipeline.unet, "unet").items()}
    # kohya's names, as trainers outside of diffusers write them
    kohya = {}
    for key, value in state.items():
        layer, end = key.split(".lora_A" if ".lora_A" in key else ".lora_B")
        kind = "lora_down" if ".lora_A" in key else "lora_up"
        kohya[f"{layer.replace('.', '_')}.{kind}{end}"] = value
        kohya[f"{layer.replace('.', '_')}.alpha"] = torch.tensor(2.0)
    save_file(kohya, tmp_path / "released.safetensors")
    pir = EnvironmentDiffusion(stable_diffusion, tmp_path / "released.safetensors", steps=2).generate("a room", seed=0)
    distance = 0.5 * SPEED_OF_LIGHT * pir.time_of_arrival
    assert np.nanmin(distance) >= 5.0
    assert np.nanmax(distance) <= 10.0 * np.sqrt(1 + 2 * np.tan(np.radians(30)) ** 2)


def test_an_embedded_lora_does_not_fit_stable_diffusion(lora: Path, stable_diffusion: Path) -> None:
    with pytest.raises(LoraError, match="another base"):
        EnvironmentDiffusion(stable_diffusion, lora)


def test_stable_diffusion_reads_no_sketches_and_wants_more_guidance(stable_diffusion: Path, model_folder: Path) -> None:
    with pytest.raises(ValueError, match="use_layout_map: True"):
        EnvironmentDiffusion(stable_diffusion, use_layout_map=True)
    assert EnvironmentDiffusion(stable_diffusion).sampler.guidance == 7.5
    assert EnvironmentDiffusion(model_folder).sampler.guidance == 1.5
    assert EnvironmentDiffusion(model_folder, guidance=4.0).sampler.guidance == 4.0


def test_the_base_has_no_text_encoder_to_adapt(corpus: ViewCorpus, model_folder: Path, tmp_path: Path) -> None:
    recipe = LoraRecipe(frames=4, steps=1, items=1, text_encoder=True)
    with pytest.raises(ValueError, match="text_encoder"):
        choose_rate(lambda: EmbeddedBase(model_folder, "cpu"), corpus, corpus, tmp_path, recipe, [1e-3])
    assert (model_folder / CONTROL_FILE).is_file()


def test_time_steps_of_a_batch_are_spread_evenly() -> None:
    drawn = torch.stack([_spread_steps(16, 1000, torch.Generator().manual_seed(k)) for k in range(200)])
    part = torch.arange(16) * 62.5
    assert ((drawn > part - 1) & (drawn < part + 62.5)).all(), "one from each sixteenth"
    assert drawn.min() < 5
    assert drawn.max() > 995
    assert abs(float(drawn.double().mean()) - 499.5) < 5.0
    assert torch.equal(drawn[3], _spread_steps(16, 1000, torch.Generator().manual_seed(3)))
