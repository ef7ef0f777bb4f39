"""Loops of all trainings: learning rate, running mean of the weights, checkpoints, precision. Callers set the seeds."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from copy import deepcopy
from dataclasses import Field, asdict, fields
from functools import wraps
from pathlib import Path
from typing import Any, ClassVar, Generic, ParamSpec, Protocol, TypeVar

import numpy as np
import torch

from rfgen_sionna.generative.environment.torch_device import DeviceMemoryError

Progress = Callable[[int, int, float], None]
"""Called with (step, steps, running mean of the loss)."""


class Schedule(Protocol):
    """Settings of a loop: a dataclass with more fields than these. A checkpoint of other settings is refused."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    @property
    def steps(self) -> int: ...

    @property
    def rate(self) -> float:
        """Learning rate at its height."""


class Recipe(Schedule, Protocol):
    """Settings that decide the outcome of a run."""

    @property
    def average(self) -> float:
        """Decay of the running mean of the weights."""


Net = TypeVar("Net", bound=torch.nn.Module)
_P = ParamSpec("_P")
_R = TypeVar("_R")


class Loop:
    """Steps down the gradient of a loss, from one checkpoint to the next.

    Args:
        parameters: those that are trained.
        optimiser: of these.
        recipe: number of steps and learning rate.
        checkpoint: its file; a loop goes on where that stopped.
        log: a line of JSON is added to that file with each checkpoint; None writes none.
        warmup: steps in which the learning rate rises; it falls over the last 40 % of them.
        forget: weight of the newest in the running mean of the loss.

    Raises:
        ValueError: the checkpoint is of another recipe, apart from more or fewer steps.
    """

    def __init__(
        self,
        parameters: Iterable[torch.nn.Parameter],
        optimiser: torch.optim.Optimizer,
        recipe: Schedule,
        checkpoint: Path,
        log: Path | None = None,
        *,
        warmup: int = 1,
        forget: float = 1.0,
    ) -> None:
        self._parameters, self._optimiser, self.recipe = list(parameters), optimiser, recipe
        self._checkpoint, self._log, self._warmup, self._forget = checkpoint, log, warmup, forget
        self._first, self._seconds = 0, 0.0
        self._loss, self._parts = float("nan"), dict[str, float]()
        if checkpoint.is_file():
            state = resume(checkpoint, recipe)
            self._load(state)
            self._optimiser.load_state_dict(state["optimiser"])
            self._first, self._seconds = state["step"], state.get("seconds", 0.0)

    def steps(
        self, save_every: int, keep: Callable[[int, float], None] | None, progress: Progress | None
    ) -> Iterator[int]:
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
                if keep is not None:
                    keep(done, spent / 3600.0)

    def learn(self, loss: torch.Tensor, **parts: float) -> None:
        """One step down the gradient of `loss`; `parts` are for the log."""
        self._optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self._parameters, 1.0)
        self._optimiser.step()
        value = float(loss.detach())
        self._loss = value if np.isnan(self._loss) else (1 - self._forget) * self._loss + self._forget * value
        self._parts = parts

    def _pace(self, step: int) -> float:
        """Share of the learning rate in a step: it rises in the warm-up and falls over the last 40 % of the steps."""
        steps = self.recipe.steps
        fall = float(np.clip((steps - step) / max(1.0, 0.4 * steps), 0.01, 1.0))
        return min(1.0, (step + 1) / min(self._warmup, max(1, steps // 4))) * fall

    def _follow(self, step: int) -> None:
        """Called after each step."""

    def _weights(self) -> dict[str, Any]:
        """Weights for a checkpoint."""
        return {"trained": [p.detach().cpu() for p in self._parameters]}

    def _load(self, state: dict[str, Any]) -> None:
        """Put the weights of a checkpoint in place."""
        for parameter, values in zip(self._parameters, state["trained"], strict=True):
            parameter.data.copy_(values)

    def _save(self, done: int, spent: float) -> None:
        state = {
            **self._weights(),
            "optimiser": self._optimiser.state_dict(),
            "step": done,
            "seconds": spent,
            "recipe": asdict(self.recipe),
        }
        write(self._checkpoint, state)
        if self._log is not None:
            line = {"step": done, "seconds": round(spent), "loss": round(self._loss, 5), **self._parts}
            with self._log.open("a", encoding="utf-8") as log:
                log.write(json.dumps(line) + "\n")


class Run(Loop, Generic[Net]):
    """Trains a network by AdamW, and keeps the running mean of its weights.

    Args:
        net: the network, on its device; weights of a checkpoint are put into it.
        recipe, checkpoint, log, warmup, forget: see :class:`Loop`.

    Raises:
        ValueError: the checkpoint is of another recipe, apart from more or fewer steps.
    """

    def __init__(
        self, net: Net, recipe: Recipe, checkpoint: Path, log: Path, *, warmup: int = 300, forget: float = 0.02
    ) -> None:
        self.net, self._average = net, recipe.average
        self.mean: Net = deepcopy(net).requires_grad_(False)
        optimiser = torch.optim.AdamW(
            net.parameters(), lr=recipe.rate, weight_decay=0.01, betas=(0.9, 0.99), fused=True
        )
        super().__init__(net.parameters(), optimiser, recipe, checkpoint, log, warmup=warmup, forget=forget)

    @torch.no_grad()
    def _follow(self, step: int) -> None:
        """Move the running mean of the weights towards the network's, faster in the beginning."""
        keep = min(self._average, (step + 1.0) / (step + 20.0))
        torch._foreach_lerp_(list(self.mean.parameters()), list(self.net.parameters()), 1.0 - keep)

    def _weights(self) -> dict[str, Any]:
        return {"net": self.net.state_dict(), "mean": self.mean.state_dict()}

    def _load(self, state: dict[str, Any]) -> None:
        self.net.load_state_dict(state["net"])
        self.mean.load_state_dict(state["mean"])


def fit(
    net: torch.nn.Module,
    loss_of: Callable[[], torch.Tensor],
    steps: int,
    *,
    rate: float = 2e-3,
    rise: float = 0.3,
    progress: Progress | None = None,
) -> None:
    """Train a small network in one go: AdamW and one cycle of the learning rate.

    Args:
        net: the network.
        loss_of: draws a batch and returns its loss.
        steps: optimiser steps.
        rate: learning rate at its height.
        rise: share of the steps in which it rises.
        progress: called with (step, steps, loss).
    """
    optimiser = torch.optim.AdamW(net.parameters(), lr=rate, weight_decay=0.05)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, rate, total_steps=steps, pct_start=rise)
    for step in range(steps):
        loss = loss_of()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
        if progress is not None:
            progress(step + 1, steps, float(loss.detach()))


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


def reports_out_of_memory(task: Callable[_P, _R]) -> Callable[_P, _R]:
    """A training whose device runs out of memory ends in a :class:`DeviceMemoryError`, which says what helps."""

    @wraps(task)
    def run(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        try:
            return task(*args, **kwargs)
        except torch.OutOfMemoryError as error:
            raise DeviceMemoryError(
                "the device is out of memory while training: take fewer images a step (--items), smaller pictures "
                "(--edge, for Stable Diffusion) or a smaller --rank, in a new folder; close what else uses the device; "
                "or take --device cpu"
            ) from error

    return run
