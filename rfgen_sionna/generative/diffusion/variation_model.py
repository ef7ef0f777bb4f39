"""A trained motion model and its file: weights in half precision, the rest in the header."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.motion_noise import MotionNoise
from rfgen_sionna.generative.diffusion.variation_net import NetworkShape, VariationNet

FORMAT = "rfgen-variation-1"
SHIPPED = Path(__file__).with_name("weights") / "variation.safetensors"
"""File of the model that ships."""


@dataclass(frozen=True)
class Scaling:
    """Means and scales of rows and context."""

    rows: tuple[FloatArray, FloatArray]
    context: tuple[FloatArray, FloatArray]


@dataclass(frozen=True)
class VariationModel:
    """A trained motion model."""

    net: VariationNet
    vocabulary: tuple[str, ...]
    """Stems of the captions that it was trained on."""
    noise: MotionNoise
    scaling: Scaling
    facts: dict[str, Any]
    """Seed, steps, device and minutes of the training."""


def read_model(path: Path = SHIPPED) -> VariationModel:
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
    net = VariationNet(NetworkShape(tuple(shape.pop("channels")), **shape), len(header["vocabulary"])).eval()
    net.load_state_dict({k.removeprefix("net."): v for k, v in tensors.items() if k.startswith("net.")})
    net.requires_grad_(False)
    array = {key: value.double().numpy() for key, value in tensors.items() if not key.startswith("net.")}
    return VariationModel(
        net,
        tuple(header["vocabulary"]),
        MotionNoise(array["noise.factor"], array["noise.amplitude"]),
        Scaling((array["rows.mean"], array["rows.scale"]), (array["context.mean"], array["context.scale"])),
        header["facts"],
    )


def write_model(path: Path, model: VariationModel) -> None:
    """Write a motion model in one step."""
    tensors = {f"net.{k}": v.to(torch.float16) for k, v in model.net.state_dict().items()}
    arrays = {"noise.factor": model.noise.factor, "noise.amplitude": model.noise.amplitude}
    for name, pair in (("rows", model.scaling.rows), ("context", model.scaling.context)):
        arrays |= {f"{name}.mean": pair[0], f"{name}.scale": pair[1]}
    tensors |= {name: torch.from_numpy(np.ascontiguousarray(values)).float() for name, values in arrays.items()}
    header = {
        "format": FORMAT,
        "shape": asdict(model.net.shape),
        "vocabulary": model.vocabulary,
        "facts": model.facts,
    }
    partial = path.with_suffix(".part")
    save_file({k: v.detach().cpu().contiguous() for k, v in tensors.items()}, partial, {"rfgen": json.dumps(header)})
    partial.replace(path)
