"""The command that examines the shipped model, and what all commands of the image models say of wrong arguments."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
import typer
from typer.testing import CliRunner

from rfgen_sionna.generative.environment.environment_model import EnvironmentModel
from rfgen_sionna.generative.environment.torch_device import DeviceMemoryError
from rfgen_sionna.generative.environment.viewpoints import ViewpointRanges
from training.commands import plainly
from training.environment import (
    control_training,
    controlnet,
    evaluate,
    image_training,
    lora,
    lora_training,
    train,
)
from training.environment.evaluate import main
from training.environment.lora_bases import EmbeddedBase
from training.environment.render import render
from training.environment.shards import Settings
from training.environment.view_corpus import ViewCorpus


@pytest.mark.filterwarnings("ignore:Matrix is singular")  # so few views span nothing
def test_views_of_another_kind_are_examined(tmp_path: Path) -> None:
    """Rolled equirectangular ones are drawn for their own captions; those of training layouts are refused."""
    data, rolled, out = (tmp_path / name for name in ("data", "rolled", "out"))
    render(data, Settings(seed=2, places=("open field",), views=1), 4)  # the first layout is for the test
    kind = ViewpointRanges(roll_deg=(20, 40), projections=("equirectangular",))
    render(rolled, Settings(seed=78, places=("open field", "bedroom"), views=1, ranges=kind), 4)
    asked: dict[str, Any] = {"seeds": 0, "view_count": 0, "judge_steps": 2, "steps": 2, "each": 1, "threads": 1}
    main(data, out, other=[rolled], **asked)
    report = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    figures = report["other views"]["rolled"]
    assert figures["views"] == 2
    assert figures["drawn"]["nothing returns"] < 0.9
    assert 0.0 < figures["drawn"]["range wasserstein, all [m]"] < 100.0
    with pytest.raises(typer.BadParameter, match="shares layouts with the training split"):
        main(data, out, other=[data], **asked)


@pytest.mark.parametrize(
    ("command", "arguments", "words"),
    [
        (train.main, ["--data", "none"], "'none' holds no shards"),
        (train.main, ["--data", "views", "--device", "gpu"], "device: 'gpu'"),
        (
            train.main,
            ["--data", "views", "--later", "kitchen", "--text-steps", "1"],
            "later: 'kitchen'; the data set has",
        ),
        (controlnet.main, ["--data", "views"], "'views' holds single views; render pairs"),
        (controlnet.main, ["--data", "views", "--base", "none.safetensors"], "none.safetensors"),
        (evaluate.main, ["--data", "views", "--split", "validation"], "'views' has no views of the split 'validation'"),
        (lora.main, ["--data", "views", "--place", "kitchen"], "place is 'kitchen'"),
    ],
)
def test_commands_say_what_is_wrong_in_a_sentence(
    command: Any, arguments: list[str], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    if "views" in arguments:
        render(tmp_path / "views", Settings(seed=2, places=("open field",), views=1, resolution=(64, 64)), 4)
    app = typer.Typer()
    app.command()(plainly(command))
    found = CliRunner().invoke(app, [*arguments, "--out", "out"])
    assert found.exit_code == 2
    assert words in " ".join(found.stderr.split())
    assert "Traceback" not in found.output


@pytest.mark.parametrize("name", ["train", "train_control", "train_lora"])
def test_training_that_runs_out_of_memory_says_what_helps(
    name: str,
    model: EnvironmentModel,
    model_folder: Path,
    corpus: ViewCorpus,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise torch.OutOfMemoryError("CUDA out of memory")

    base = EmbeddedBase(model_folder, "cpu")
    short, control = image_training.ImageRecipe(steps=1, items=2), control_training.ControlRecipe(steps=1, items=2)
    lora_recipe = lora_training.LoraRecipe(steps=1, items=2)
    tasks: dict[str, Callable[[], Any]] = {
        "train": lambda: image_training.train(corpus, model.vae, model.text, tmp_path, short, shape=model.shape),
        "train_control": lambda: control_training.train_control(corpus, model, tmp_path, control),
        "train_lora": lambda: lora_training.train_lora(base, corpus, tmp_path, lora_recipe, 1e-3),
    }
    monkeypatch.setattr(type(model.unet), "forward", full)
    with pytest.raises(DeviceMemoryError, match="fewer images a step"):
        tasks[name]()
