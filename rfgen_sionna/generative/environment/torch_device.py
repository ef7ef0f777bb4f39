"""The device that networks run on: its choice, its precision, and errors where its memory is short."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch

from rfgen_sionna.scene.scene_errors import BackendError


class DeviceMemoryError(BackendError):
    """The device ran out of memory."""


@contextmanager
def memory_errors(device: str) -> Iterator[None]:
    """Within it a device that runs out of memory is a :class:`DeviceMemoryError`, which says what helps."""
    try:
        yield
    except torch.OutOfMemoryError as error:
        raise DeviceMemoryError(
            f"device {device}: out of memory; draw fewer images at once, close what else uses the device, or take "
            "device='cpu'"
        ) from error


def precision(device: str, half: bool | None) -> torch.dtype:
    """What networks compute in on a device; None is half precision on CUDA alone."""
    on_cuda = torch.device(device).type == "cuda"
    if not (on_cuda if half is None else half):
        return torch.float32
    return torch.float16 if on_cuda else torch.bfloat16


def pick_device(device: str | None) -> str:
    """The device that is meant.

    Raises:
        ValueError: there is no such device here.
    """
    if device is None:
        return "cuda" if torch.cuda.is_available() else "cpu"
    try:
        kind = torch.device(device).type
    except RuntimeError:
        raise ValueError(f"device: {device!r}; 'cpu', 'cuda' or 'cuda:1' and the like are allowed") from None
    if kind == "cuda" and not torch.cuda.is_available():
        raise ValueError(
            f"device: {device!r}, but PyTorch finds no CUDA device here; take 'cpu', or a CUDA build of it"
        )
    return device
