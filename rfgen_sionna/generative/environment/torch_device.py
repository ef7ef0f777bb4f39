"""Device of the networks: choice, precision, and errors of its memory."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch

from rfgen_sionna.scene.scene_errors import BackendError


class DeviceMemoryError(BackendError):
    """The device ran out of memory."""


@contextmanager
def memory_errors(device: str) -> Iterator[None]:
    """Context that turns a device's lack of memory into a :class:`DeviceMemoryError`."""
    try:
        yield
    except torch.OutOfMemoryError as error:
        raise DeviceMemoryError(
            f"device {device}: out of memory; draw fewer images at once, close what else uses the device, or take "
            "device='cpu'"
        ) from error


def precision(device: str, half: bool | None) -> torch.dtype:
    """Floating-point type of the networks; None takes half precision on CUDA only."""
    on_cuda = torch.device(device).type == "cuda"
    if not (on_cuda if half is None else half):
        return torch.float32
    return torch.float16 if on_cuda else torch.bfloat16


def pick_device(device: str | None) -> str:
    """Name of a device; None takes CUDA where available.

    Raises:
        ValueError: there is no such device.
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
