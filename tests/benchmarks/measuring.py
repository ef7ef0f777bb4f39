"""Times, memory and what a run was made with."""

from __future__ import annotations

import gc
import hashlib
import inspect
import os
import platform
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from rfgen_sionna.recipes.set_facts import processor_name

T = TypeVar("T")
PACKAGES = ("rfgen_sionna", "numpy", "scipy", "drjit", "mitsuba", "sionna-rt", "finufft", "miepython", "torch", "anny")
_STATUS, _REFS = Path("/proc/self/status"), Path("/proc/self/clear_refs")


ROOT = Path(__file__).resolve().parents[2]


def default_rtol() -> float:
    """What a simulation is right to if nobody says."""
    from rfgen_sionna.simulation import Simulator

    return float(inspect.signature(Simulator).parameters["rtol"].default)


def code() -> dict[str, Any]:
    """Which state of the code is measured: its commit, and a hash of what is in its files."""
    total = hashlib.sha256()
    for folder in ("rfgen_sionna", "tests/benchmarks"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            total.update(path.read_bytes())
    asked = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False)
    return {"commit": asked.stdout.strip() or None, "digest": total.hexdigest()[:16]}


def timed(work: Callable[[], T]) -> tuple[float, T]:
    """Seconds that `work` takes, and what it returns."""
    begin = time.perf_counter()
    result = work()
    return time.perf_counter() - begin, result


def best_of(work: Callable[[], Any], repeats: int = 3) -> float:
    """Shortest time [s] after one run that compiles: on a machine that others use, too, the least disturbed one."""
    work()
    return min(timed(work)[0] for _ in range(repeats))


@dataclass
class Peak:
    """Largest resident memory within a block beyond what was there before [MB]; None where the system doesn't tell."""

    megabytes: float | None = None

    def __enter__(self) -> Peak:
        gc.collect()
        try:
            _REFS.write_text("5", encoding="ascii")  # the high-water mark starts anew
            self._before: float | None = _field("VmRSS")
        except OSError:
            self._before = None
        return self

    def __exit__(self, *_: object) -> None:
        if self._before is not None:
            self.megabytes = max(0.0, _field("VmHWM") - self._before)


def resident() -> float | None:
    """Resident memory now [MB]; None where the system doesn't tell."""
    return _field("VmRSS") if _STATUS.is_file() else None


def _field(name: str) -> float:
    line = next(line for line in _STATUS.read_text(encoding="ascii").splitlines() if line.startswith(name))
    return float(line.split()[1]) / 1e3


def machine() -> dict[str, Any]:
    from rfgen_sionna.scene.mitsuba_backend import ensure_backend

    return {
        "cores": os.cpu_count(),
        "usable_cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "processor": processor_name(),
        "system": f"{platform.system()} {platform.machine()}",
        "variant": ensure_backend(),
    }


def versions() -> dict[str, str]:
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def exponent(sizes: list[float], seconds: list[float]) -> float:
    """b of seconds = a size^b, fitted to the larger half of the sizes, where fixed costs count least."""
    first = len(sizes) // 2 if len(sizes) > 3 else 0
    return float(np.polyfit(np.log(sizes[first:]), np.log(seconds[first:]), 1)[0])
