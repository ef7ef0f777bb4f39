"""What is said where a device runs out of memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import ParamSpec, TypeVar

import torch

from rfgen_sionna.scene.errors import BackendError

_P = ParamSpec("_P")
_R = TypeVar("_R")


class DeviceMemoryError(BackendError):
    """The device ran out of memory."""


@contextmanager
def memory_of(device: str) -> Iterator[None]:
    """Within it a device that runs out of memory is a :class:`DeviceMemoryError`, which says what helps."""
    try:
        yield
    except torch.OutOfMemoryError as error:
        raise DeviceMemoryError(
            f"device {device}: out of memory; draw fewer images at once, close what else uses the device, or take "
            "device='cpu'"
        ) from error


def training(task: Callable[_P, _R]) -> Callable[_P, _R]:
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
