"""A training run: learning rate, running mean of the weights, checkpoints, precision. Seeds are the caller's; it is
resumable."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from copy import deepcopy
from dataclasses import Field, asdict, fields
from hashlib import sha256
from pathlib import Path
from typing import Any, ClassVar, Generic, Protocol, TypeVar

import numpy as np
import torch

Progress = Callable[[int, int, float], None]
"""Called with (step, steps, running mean of the loss)."""


class Recipe(Protocol):
    """What decides the outcome of a run: a dataclass with more fields than these."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    @property
    def steps(self) -> int: ...

    @property
    def rate(self) -> float:
        """Learning rate at its height."""

    @property
    def average(self) -> float:
        """Decay of the running mean of the weights."""


Net = TypeVar("Net", bound=torch.nn.Module)


class Run(Generic[Net]):
    """Trains a network by AdamW, and keeps the running mean of its weights.

    Args:
        net: what is trained, on its device; what a checkpoint holds is put into it.
        recipe: what to do.
        checkpoint: its file; a run goes on where that stopped.
        log: a line of JSON is added to that file with each checkpoint.
        warmup: steps in which the learning rate rises; it falls over the last 40 % of them.
        forget: weight of the newest in the running mean of the loss.

    Raises:
        ValueError: the checkpoint is of another recipe, apart from more or fewer steps.
    """

    def __init__(
        self, net: Net, recipe: Recipe, checkpoint: Path, log: Path, *, warmup: int = 300, forget: float = 0.02
    ) -> None:
        self.net, self.recipe = net, recipe
        self.mean: Net = deepcopy(net).requires_grad_(False)
        self._checkpoint, self._log, self._warmup, self._forget = checkpoint, log, warmup, forget
        self._optimiser = torch.optim.AdamW(
            net.parameters(), lr=recipe.rate, weight_decay=0.01, betas=(0.9, 0.99), fused=True
        )
        self._first, self._seconds = 0, 0.0
        self._loss, self._parts = float("nan"), dict[str, float]()
        if checkpoint.is_file():
            state = resume(checkpoint, recipe)
            net.load_state_dict(state["net"])
            self.mean.load_state_dict(state["mean"])
            self._optimiser.load_state_dict(state["optimiser"])
            self._first, self._seconds = state["step"], state["seconds"]

    def steps(self, save_every: int, keep: Callable[[int, float], None], progress: Progress | None) -> Iterator[int]:
        """The steps that are left; :meth:`learn` is to be called in each.

        Args:
            save_every: steps between checkpoints; there is one after the last as well.
            keep: called with (steps done, hours) at each, to write what has been learned.
            progress: called after each step.
        """
        started = time.monotonic()
        for step in range(self._first, self.recipe.steps):
            for group in self._optimiser.param_groups:
                group["lr"] = self.recipe.rate * self._pace(step)
            yield step
            self._follow(step)
            done = step + 1
            if progress is not None:
                progress(done, self.recipe.steps, self._loss)
            if done % save_every == 0 or done == self.recipe.steps:
                spent = self._seconds + time.monotonic() - started
                self._save(done, spent)
                with self._log.open("a", encoding="utf-8") as log:
                    told = {"step": done, "seconds": round(spent), "loss": round(self._loss, 5), **self._parts}
                    log.write(json.dumps(told) + "\n")
                keep(done, spent / 3600.0)

    def learn(self, loss: torch.Tensor, **parts: float) -> None:
        """One step down the gradient of `loss`; `parts` are for the log."""
        self._optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.net.parameters(), 1.0)
        self._optimiser.step()
        value = float(loss.detach())
        self._loss = value if np.isnan(self._loss) else (1 - self._forget) * self._loss + self._forget * value
        self._parts = parts

    def _pace(self, step: int) -> float:
        """Share of the learning rate."""
        steps = self.recipe.steps
        return min(1.0, (step + 1) / min(self._warmup, max(1, steps // 4))) * cool(step, steps)

    @torch.no_grad()
    def _follow(self, step: int) -> None:
        """Move the running mean of the weights towards the network's, faster in the beginning."""
        keep = min(self.recipe.average, (step + 1.0) / (step + 20.0))
        torch._foreach_lerp_(list(self.mean.parameters()), list(self.net.parameters()), 1.0 - keep)

    def _save(self, done: int, spent: float) -> None:
        state = {
            "net": self.net.state_dict(),
            "mean": self.mean.state_dict(),
            "optimiser": self._optimiser.state_dict(),
            "step": done,
            "seconds": spent,
            "recipe": asdict(self.recipe),
        }
        write(self._checkpoint, state)


def cool(step: int, steps: int) -> float:
    """Share of the learning rate in a step: it falls over the last 40 % of the `steps`."""
    return float(np.clip((steps - step) / max(1.0, 0.4 * steps), 0.01, 1.0))


def precision(device: str | torch.device = "cpu") -> AbstractContextManager[Any]:
    """bfloat16 where matrices are multiplied, on devices with units for that; without them single precision is quicker
    (1.7 times, for the environment model on two cores with AVX-512 and no AMX)."""
    kind = torch.device(device).type
    units: Mapping[str, Any] = torch.cpu.get_capabilities() if hasattr(torch.cpu, "get_capabilities") else {}
    if kind == "cpu" and not units.get("amx_bf16", False):
        return nullcontext()
    return torch.autocast(kind, torch.bfloat16)


def write(path: Path, state: dict[str, Any]) -> None:
    """Write a checkpoint, whole or not at all."""
    partial = path.with_suffix(".part")
    torch.save(state, partial)
    partial.replace(path)


def fingerprint(net: torch.nn.Module | None) -> str:
    """Tells the weights of one network from those of another; empty for none."""
    if net is None:
        return ""
    told = sha256()
    for name, values in sorted(net.state_dict().items()):
        told.update(name.encode())
        told.update(values.detach().cpu().double().numpy().tobytes())
    return told.hexdigest()[:16]


def resume(path: Path, recipe: Any) -> dict[str, Any]:
    """The state in a checkpoint.

    Raises:
        ValueError: it was made with another recipe; fields that it does not know had their defaults.
    """
    state: dict[str, Any] = torch.load(path, weights_only=True, map_location="cpu")
    usual = {each.name: each.default for each in fields(recipe)}
    if {**usual, **state["recipe"], "steps": 0} != {**asdict(recipe), "steps": 0}:
        raise ValueError(f"out: {path} was made with {state['recipe']}, not with {asdict(recipe)}; use another folder")
    return state
