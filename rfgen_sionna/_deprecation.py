"""Former public names, which work for one version with a warning."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Mapping
from typing import Any


def warn_renamed(old: str, new: str, *, stacklevel: int = 3) -> None:
    """Warn that `old` is the former name of `new`; `stacklevel` is that of `warnings.warn`."""
    message = f"{old} is deprecated and will be removed in the next version: use {new}"
    warnings.warn(message, DeprecationWarning, stacklevel=stacklevel)


def refuse_workers(workers: object) -> None:
    """Raise ValueError for the former argument `workers`, the number of processes of one recording."""
    if workers is not None:
        raise ValueError(
            f"workers is {workers!r}, but one process makes a recording: leave it out. "
            "`rfgen dataset build` (rfgen_sionna.build_dataset) makes many recordings side by side"
        )


class Renamed:
    """Former name of the attribute or method `new` of a class."""

    def __init__(self, new: str) -> None:
        self._new = new
        self._old = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self._old = name

    def __get__(self, instance: Any, owner: type) -> Any:
        warn_renamed(f"{owner.__name__}.{self._old}", f"{owner.__name__}.{self._new}")
        return getattr(owner if instance is None else instance, self._new)


def former_names(module: str, names: Mapping[str, str]) -> Callable[[str], Any]:
    """`__getattr__` of the module named `module`; `names` maps former names to present ones."""

    def get(name: str) -> Any:
        if name not in names:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        warn_renamed(f"{module}.{name}", f"{module}.{names[name]}")
        return getattr(sys.modules[module], names[name])

    return get
