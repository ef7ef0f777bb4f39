"""A training run goes on where it was stopped as if it had not been, and refuses another recipe's checkpoint."""

from dataclasses import dataclass, replace

import pytest
import torch

from training.learning import Run


@dataclass(frozen=True)
class Recipe:
    steps: int = 12
    rate: float = 1e-2
    average: float = 0.9
    seed: int = 0


def trained(folder, recipe, stop=None, save_every=4):
    torch.manual_seed(recipe.seed)
    run = Run(torch.nn.Linear(3, 1), recipe, folder / "checkpoint.pt", folder / "log.jsonl")
    kept, told = [], []
    x = torch.linspace(-1, 1, 12).reshape(4, 3)
    for step in run.steps(save_every, lambda done, _: kept.append(done), lambda *a: told.append(a)):
        if step == stop:
            break
        run.learn(((run.net(x + 0.1 * step) - x.sum(1, keepdim=True)) ** 2).mean(), plain=1.0)
    return run, kept, told


def test_an_interrupted_run_ends_with_the_same_bits(tmp_path):
    for name in ("whole", "parts"):
        (tmp_path / name).mkdir()
    whole, kept, told = trained(tmp_path / "whole", Recipe())
    assert kept == [4, 8, 12]
    assert [each[:2] for each in told] == [(k + 1, 12) for k in range(12)]
    assert told[-1][2] < told[0][2]
    _, before, _ = trained(tmp_path / "parts", Recipe(), stop=6)
    again, after, _ = trained(tmp_path / "parts", Recipe())
    assert (before, after) == ([4], [8, 12])
    for one, other in zip((whole.net, whole.mean), (again.net, again.mean), strict=True):
        for a, b in zip(one.parameters(), other.parameters(), strict=True):
            assert torch.equal(a, b)
    assert not torch.equal(whole.net.weight, whole.mean.weight)
    assert len((tmp_path / "whole" / "log.jsonl").read_text().splitlines()) == 3


def test_a_checkpoint_of_another_recipe_is_refused_and_more_steps_are_not(tmp_path):
    trained(tmp_path, Recipe())
    with pytest.raises(ValueError, match=r"'rate': 0\.01.*use another folder"):
        trained(tmp_path, replace(Recipe(), rate=2e-2))
    _, kept, _ = trained(tmp_path, replace(Recipe(), steps=16))
    assert kept == [16]
