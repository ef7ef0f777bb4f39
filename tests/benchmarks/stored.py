"""Integrals that take long, kept by what they depend on.

`results/truth.json` has those of the benchmark's bodies: a car at 77 GHz takes minutes. Each is kept under a hash of
all that goes into it (vertices, faces, what may hide them, band, material, how the surface is smoothed) and of the
question, so that whatever changes is integrated anew. What a run had to integrate itself is kept in its own folder.

    python -m tests.benchmarks.keep_truth            integrates what is missing in results/truth.json
    python -m tests.benchmarks.keep_truth --check    integrates one answer of each body again and compares
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from rfgen_sionna._types import ComplexArray, FloatArray, IntArray
from tests.benchmarks.truth import VERSION, Probe, Quadrature

SHIPPED = Path(__file__).parent / "results" / "truth.json"
RESOLUTION = 1e-7
"""Places that differ by less are the same [m]: the last bits of a body are the processor's."""


def identity(quadrature: Quadrature, hides: Iterable[tuple[FloatArray, IntArray]] = ()) -> str:
    """Of all that the answers depend on; `hides` are (vertices, faces) of what else stands there."""
    kind = f"{VERSION} {quadrature.frequency:.9g} {quadrature.oversampling:g} {complex(quadrature.permittivity):.9g}"
    total = hashlib.sha256(kind.encode())
    meshes = [(quadrature.vertices, quadrature.faces), *hides]
    sagittas = np.zeros(0) if quadrature.sagittas is None else quadrature.sagittas
    for places in (*(vertices - quadrature.viewpoint for vertices, _ in meshes), sagittas, quadrature.field):
        total.update(np.rint(np.asarray(places) / RESOLUTION).astype(np.int64).tobytes())
    for _, faces in meshes:
        total.update(np.asarray(faces, np.int64).tobytes())
    return total.hexdigest()[:16]


def question(probe: Probe) -> str:
    """In words that are the same wherever the same numbers are computed."""
    offset = " ".join(f"{1e9 * each:.1f}" for each in probe.offset).replace("-0.0", "0.0")
    permittivity = "" if probe.permittivity is None else f" {probe.permittivity:.9g}"
    return f"{offset} nm {probe.linear:.11g} {probe.square:.11g}{permittivity}"


class Store:
    """Answers by hash: those that are shipped, and a file for more."""

    def __init__(self, extra: Path | None = None, shipped: Path | None = SHIPPED) -> None:
        self._extra = extra
        self._added: dict[str, list[float]] = read(extra)
        self._known = read(shipped) | self._added
        self.used: set[str] = set()
        """Keys of the answers that were asked for."""
        self.integrated = 0
        """Answers that had to be integrated."""

    def sums(
        self, quadrature: Quadrature, probes: Sequence[Probe], hides: Iterable[tuple[FloatArray, IntArray]] = ()
    ) -> ComplexArray:
        """:meth:`tests.benchmarks.truth.Quadrature.sums`; `hides` is what else stands there."""
        base = identity(quadrature, hides)
        keys = [hashlib.sha256(f"{base} {question(probe)}".encode()).hexdigest()[:20] for probe in probes]
        self.used |= set(keys)
        missing = [index for index, key in enumerate(keys) if key not in self._known]
        if missing:
            found = quadrature.sums([probes[index] for index in missing])
            new = {keys[index]: [value.real, value.imag] for index, value in zip(missing, found.tolist(), strict=True)}
            self._known |= new
            self._added |= new
            self.integrated += len(new)
            if self._extra is not None:
                self._extra.write_text(as_text(self._added), encoding="utf-8")
        return np.array([complex(*self._known[key]) for key in keys])


def read(path: Path | None) -> dict[str, list[float]]:
    """What a file holds; nothing where there is none."""
    found: dict[str, list[float]] = {}
    if path is not None and path.is_file():
        found = json.loads(path.read_text(encoding="utf-8"))
    return found


def as_text(values: dict[str, list[float]]) -> str:
    rows = ",\n".join(f" {json.dumps(key)}: {json.dumps(value)}" for key, value in sorted(values.items()))
    return "{\n" + rows + "\n}\n"
