"""A trained motion model and its file: weights in half precision, the rest in the header."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import safe_open

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.features import HandBasis
from rfgen_sionna.generative.diffusion.network import DenoisingNet, NetworkShape, Residual
from rfgen_sionna.generative.diffusion.rhythm import Beat
from rfgen_sionna.generative.diffusion.sentence_encoder import TextEncoder

FORMAT = "rfgen-motion-1"


@dataclass(frozen=True)
class MotionModel:
    """A trained motion model."""

    net: DenoisingNet
    text: TextEncoder
    hands: HandBasis
    beats: dict[str, Beat]
    mean: FloatArray
    """(NUM_FEATURES,) mean of the features."""
    scale: FloatArray
    """(NUM_FEATURES,) scale of the features."""
    facts: dict[str, Any]
    """Seed, steps, hours of the training."""
    stems: frozenset[str]
    """Stems of the training words."""
    residuals: dict[str, Residual] = field(default_factory=dict)
    """Action -> measured residual of the network; empty where there is no measurement."""


def read_model(path: Path) -> MotionModel:
    """A motion model from a file, ready for sampling on the CPU.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is no motion model of this version.
    """
    if not path.is_file():
        raise FileNotFoundError(f"no motion model at {path}")
    with safe_open(path, "pt") as file:
        header = json.loads((file.metadata() or {}).get("rfgen", "{}"))
        if header.get("format") != FORMAT:
            raise ValueError(f"{path.name}: format {header.get('format')!r}; this version reads {FORMAT!r}")
        tensors = {key: file.get_tensor(key).float() for key in file.keys()}  # noqa: SIM118
    shape = header["shape"]
    net = DenoisingNet(NetworkShape(tuple(shape.pop("channels")), **shape)).eval()
    text = TextEncoder(tuple(header["actions"])).eval()
    for name, module in (("net", net), ("text", text)):
        module.load_state_dict({k.removeprefix(f"{name}."): v for k, v in tensors.items() if k.startswith(f"{name}.")})
        module.requires_grad_(False)
    return MotionModel(
        net,
        text,
        HandBasis(tensors["hands.mean"].double().numpy(), tensors["hands.components"].double().numpy()),
        {name: Beat(**beat) for name, beat in header["beats"].items()},
        tensors["features.mean"].double().numpy(),
        tensors["features.scale"].double().numpy(),
        header["facts"],
        frozenset(header["stems"]),
        {
            name: Residual(
                tensors[f"residual.{name}.directions"].double().numpy(),
                np.array(levels),
                tensors[f"residual.{name}.gains"].double().numpy(),
            )
            for name, levels in header["levels"].items()
        },
    )
