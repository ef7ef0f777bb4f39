"""Dr.Jit's float64 array types for the back end in use.

Mitsuba and Sionna run in float32; phases need more, and Dr.Jit itself has float64 on every back end.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

from rfgen_sionna.scene.backend import ensure_backend


def drjit_types() -> tuple[ModuleType, Any]:
    """Dr.Jit and its module of (non-differentiable) array types: `drjit.llvm` or `drjit.cuda`."""
    variant = ensure_backend()
    import drjit

    return drjit, drjit.cuda if variant.startswith("cuda") else drjit.llvm
