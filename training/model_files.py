"""Files of trained models: writers for the readers in the package."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from diffusers import ControlNetModel
from safetensors.torch import save_file
from torch import Tensor

from rfgen_sionna.generative.environment.adapters import FORMAT as LORA_FORMAT
from rfgen_sionna.generative.environment.adapters import LoraFacts
from rfgen_sionna.generative.environment.classifier import ConfidenceGate
from rfgen_sionna.generative.environment.conditional_prior import TABLES
from rfgen_sionna.generative.environment.environment_model import CONTROL_FORMAT, GATE_PREFIX, EnvironmentModel
from rfgen_sionna.generative.environment.environment_model import FORMAT as ENVIRONMENT_FORMAT


def write_environment_model(path: Path, model: EnvironmentModel) -> None:
    """Write an environment model without its ControlNet in one step; networks in half precision."""
    tensors = {f"unet.{k}": v for k, v in model.unet.state_dict().items()}
    tensors |= {f"text.{k}": v for k, v in model.text.state_dict().items()}
    header = {
        "format": ENVIRONMENT_FORMAT,
        "shape": asdict(model.shape),
        "codec": asdict(model.codec),
        "places": model.text.places,
        "things": model.text.things,
        "facts": model.facts,
        "polish": asdict(model.edge_smoothing),
        "finishes": model.conditional_prior.finishes if model.conditional_prior is not None else (),
    }
    exact = {f"vae.{k}": v.float() for k, v in model.vae.state_dict().items()}
    if model.conditional_prior is not None:
        tables = {name: getattr(model.conditional_prior, name) for name in TABLES}
        exact |= {f"expectation.{k}": torch.from_numpy(v).float() for k, v in tables.items()}
    _write(path, {k: v.half() for k, v in tensors.items()} | exact, header)


def write_control(
    path: Path, control: ControlNetModel, facts: dict[str, Any], confidence_gate: ConfidenceGate | None = None
) -> None:
    """Write a ControlNet and its gate in one step, in half precision; None writes a gate that applies all gains."""
    confidence_gate = confidence_gate or ConfidenceGate()
    tensors = dict(control.state_dict())
    if confidence_gate.classifier is not None:
        tensors |= {GATE_PREFIX + k: v for k, v in confidence_gate.classifier.net.state_dict().items()}
    header = {"format": CONTROL_FORMAT, "facts": facts, "share": confidence_gate.share}
    _write(path, {k: v.half() for k, v in tensors.items()}, header)


def save_lora(path: Path, state: dict[str, Tensor], facts: LoraFacts) -> None:
    """Write a LoRA in one step, in half precision, as diffusers reads it."""
    header = {"format": LORA_FORMAT, **facts.__dict__}
    _write(path, {k: v.half() for k, v in state.items()}, header)


def _write(path: Path, tensors: dict[str, Tensor], header: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".part")
    save_file({k: v.detach().cpu().contiguous() for k, v in tensors.items()}, partial, {"rfgen": json.dumps(header)})
    partial.replace(path)
