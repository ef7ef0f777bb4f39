"""Training of the image model and of its ControlNet."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from rfgen_sionna.generative.environment.environment_model import (
    BASE_FILE,
    EnvironmentModel,
    ModelFileError,
    UNetShape,
    read_control,
    read_model,
)
from rfgen_sionna.generative.environment.path_diffusion import PathDiffusion
from rfgen_sionna.generative.environment.view_unet import make_scheduler
from training.environment.control_training import ControlRecipe, diffuse_towards, train_control
from training.environment.image_training import ImageRecipe, train
from training.environment.place_text import train_text
from training.environment.view_corpus import ViewCorpus
from training.model_files import write_environment_model


def test_the_sentence_encoder_learns_what_is_named(corpus: ViewCorpus) -> None:
    encoder = train_text(corpus.draw, corpus.names, corpus.things, steps=40, batch=24)
    assert encoder.place_of("a living room with a sofa")[0] == "living room"
    assert encoder.place_of("bedroom, a lamp")[0] == "bedroom"


def test_training_goes_on_where_it_was_stopped(model: EnvironmentModel, corpus: ViewCorpus, tmp_path: Path) -> None:
    class Stop(Exception):  # noqa: N818 - no error
        pass

    def stop(step: int, *_: Any) -> None:
        if step == 3:
            raise Stop

    def run(out: Path, progress: Any = None, seed: int = 0) -> Any:
        recipe = ImageRecipe(steps=4, items=2, seed=seed, later="bedroom", later_from=1)
        train(corpus, model.vae, model.text, out, recipe, shape=model.shape, save_every=1, progress=progress)
        return torch.load(out / "checkpoint.pt", weights_only=True)

    with pytest.raises(Stop):
        run(tmp_path / "stopped", stop)
    assert torch.load(tmp_path / "stopped" / "checkpoint.pt", weights_only=True)["step"] == 2
    with pytest.raises(ValueError, match="use another folder"):
        run(tmp_path / "stopped", seed=1)
    gone_on, whole = run(tmp_path / "stopped"), run(tmp_path / "whole")
    for part in ("net", "mean"):
        assert all(torch.equal(v, whole[part][k]) for k, v in gone_on[part].items())
    assert (tmp_path / "whole" / "without-later.safetensors").is_file()
    assert read_model(tmp_path / "whole").facts["steps"] == 4


def test_the_control_net_learns_and_the_base_stays(model: EnvironmentModel, corpus: ViewCorpus, tmp_path: Path) -> None:
    base = read_model(_written(model, tmp_path / "base"))
    before = {k: v.clone() for k, v in base.unet.state_dict().items()}
    path = train_control(corpus, base, tmp_path / "out", ControlRecipe(steps=2, items=2))
    assert all(torch.equal(v, before[k]) for k, v in base.unet.state_dict().items())
    own = read_model(tmp_path / "base", path)
    assert own.control_facts["steps"] == 2
    assert len(own.control_facts["spread"]) == model.shape.latents
    assert any(float(b.weight.abs().max()) > 0 for b in own.control.controlnet_down_blocks), "zero convolutions moved"
    shape = UNetShape(channels=(16, 32, 32), latents=32, heads=2)
    other = _written(replace(model, shape=shape, unet=shape.unet()), tmp_path / "other")
    with pytest.raises(ModelFileError, match="another base model"):
        read_model(other, path)
    torch.manual_seed(5)
    twin = replace(model, unet=model.shape.unet())
    with pytest.raises(ModelFileError, match=r"same shape, with other weights; take the one beside its base"):
        read_model(_written(twin, tmp_path / "twin"), path)
    with pytest.raises(ModelFileError, match="other weights"):
        PathDiffusion(tmp_path / "twin", path)
    begun = read_control(path, twin.unet, any_base=True).net
    assert all(torch.equal(v, own.control.state_dict()[k]) for k, v in begun.state_dict().items())
    with pytest.raises(ValueError, match="use another folder"):  # what was trained on one base goes on with no other
        train_control(corpus, twin, tmp_path / "out", ControlRecipe(steps=3, items=2))
    with pytest.raises(ValueError, match="pairs"):
        train_control(replace(corpus, incomplete=None), base, tmp_path / "none", ControlRecipe(steps=1))


def test_training_begins_with_what_a_trained_model_knows(
    model: EnvironmentModel, corpus: ViewCorpus, tmp_path: Path
) -> None:
    gently = {"steps": 1, "items": 2, "rate": 1e-9}
    path = train(
        corpus,
        model.vae,
        model.text,
        tmp_path,
        ImageRecipe(**gently),
        shape=model.shape,
        start=model,  # type: ignore[arg-type]
    )
    went_on, before = read_model(path), model.unet.state_dict()
    for name, value in went_on.unet.state_dict().items():
        if name != "spread":  # measured on the views
            torch.testing.assert_close(value, before[name], atol=1e-4, rtol=1e-3)  # kept in half precision
    assert went_on.facts["start"] == model.facts
    control = train_control(corpus, went_on, tmp_path, ControlRecipe(**gently), start=model.control)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="use another folder"):  # what was begun with one start goes on with no other
        train_control(corpus, went_on, tmp_path, ControlRecipe(**gently))  # type: ignore[arg-type]
    kept = read_model(path, control).control.state_dict()
    for name, value in model.control.state_dict().items():
        torch.testing.assert_close(kept[name], value, atol=1e-4, rtol=1e-3)


def _written(model: EnvironmentModel, folder: Path) -> Path:

    write_environment_model(folder / BASE_FILE, model)
    return folder


def test_noise_on_the_incomplete_image_leads_to_the_complete_one() -> None:
    rng = torch.Generator().manual_seed(0)
    clean, start = torch.randn(2, 6, 4, 8, 8, generator=rng)
    started = torch.tensor([True, False] * 3)
    noisy, steps, velocity = diffuse_towards(clean, start, started, rng)
    share = make_scheduler().alphas_cumprod[steps][:, None, None, None]
    assert torch.allclose(share.sqrt() * noisy - (1 - share).sqrt() * velocity, clean, atol=1e-4)
    assert int(steps[started].min()) >= 350
