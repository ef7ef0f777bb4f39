"""The environment model in memory and on disk."""

from __future__ import annotations

import json
from copy import deepcopy
from dataclasses import dataclass, field, replace
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from diffusers import ControlNetModel, UNet2DConditionModel
from safetensors import safe_open
from torch import Tensor

from rfgen_sionna.generative.environment.adapters import fingerprint
from rfgen_sionna.generative.environment.autoencoder import PatchAutoencoder
from rfgen_sionna.generative.environment.classifier import ConfidenceGate
from rfgen_sionna.generative.environment.conditional_prior import ConditionalPrior
from rfgen_sionna.generative.environment.edge_smoothing import EdgePreservingSmoothing
from rfgen_sionna.generative.environment.place_encoder import PlaceEncoder
from rfgen_sionna.generative.environment.sentence_encoder import WIDTH
from rfgen_sionna.generative.environment.view_unet import ViewUNet
from rfgen_sionna.pir.codec import PirCodec

FORMAT = "rfgen-environment-3"
CONTROL_FORMAT = "rfgen-environment-control-3"
BASE_FILE, CONTROL_FILE = "environment.safetensors", "control.safetensors"
GATE_PREFIX = "doubt."
"""Prefix of the gate's tensors in a ControlNet file."""
LATENT_SIZE = 16
"""Edge of the latent image."""


class ModelFileError(ValueError):
    """A file is no environment model, or one of another kind."""


@dataclass(frozen=True)
class UNetShape:
    """Sizes of the denoising network."""

    channels: tuple[int, ...] = (96, 160, 256)
    latents: int = 32
    heads: int = 4

    def unet(self) -> ViewUNet:
        """Network with random weights; attention is below full resolution, where it is cheap."""
        return ViewUNet(
            sample_size=LATENT_SIZE,
            in_channels=self.latents,
            out_channels=self.latents,
            block_out_channels=self.channels,
            down_block_types=("DownBlock2D", "CrossAttnDownBlock2D", "CrossAttnDownBlock2D"),
            up_block_types=("CrossAttnUpBlock2D", "CrossAttnUpBlock2D", "UpBlock2D"),
            mid_block_type="UNetMidBlock2DCrossAttn",
            layers_per_block=1,
            cross_attention_dim=WIDTH,
            attention_head_dim=self.heads,
            norm_num_groups=16,
        )


@dataclass(frozen=True)
class EnvironmentModel:
    """A trained model."""

    unet: UNet2DConditionModel
    vae: PatchAutoencoder
    text: PlaceEncoder
    codec: PirCodec
    shape: UNetShape
    facts: dict[str, Any] = field(default_factory=dict)
    """Seed, steps, hours and data of the training."""
    edge_smoothing: EdgePreservingSmoothing = field(default_factory=lambda: EdgePreservingSmoothing(8))
    """Smoothing of drawn images."""
    conditional_prior: ConditionalPrior | None = None
    """Prior for layout maps; None draws from words alone."""
    word: str = ""
    """First word of prompts, of a merged RF LoRA; or empty."""
    control: ControlNetModel | None = None
    control_facts: dict[str, Any] = field(default_factory=dict)
    """Facts of the ControlNet."""
    confidence_gate: ConfidenceGate | None = None
    """Gate of the ControlNet's gains; None without a ControlNet."""

    def to(self, device: str | torch.device, dtype: torch.dtype) -> EnvironmentModel:
        """Move the networks in place, to precision `dtype`."""
        for part in (self.unet, self.control):
            if part is not None:
                torch.nn.Module.to(part, device=device, dtype=dtype)  # without diffusers' warning
        torch.nn.Module.to(self.vae, device=device)
        self.text.to(device=device)
        return self


def new_control(unet: UNet2DConditionModel) -> ControlNetModel:
    """Untrained ControlNet of `unet` for images of full resolution with channels in 0 … 1."""
    return ControlNetModel.from_unet(unet, conditioning_embedding_out_channels=(16, 32, 96), conditioning_channels=3)


class Control(NamedTuple):
    """Contents of a ControlNet file."""

    net: ControlNetModel
    facts: dict[str, Any]
    """Seed, steps, hours and data of the training."""
    confidence_gate: ConfidenceGate
    """Gate of its gains."""


def read_model(path: Path | None = None, control: Path | bool | None = None) -> EnvironmentModel:
    """A model, ready for sampling in single precision on the CPU.

    Args:
        path: the model's file or folder; None takes the shipped model.
        control: file of a ControlNet; True takes the one beside the model, None or False none.

    Raises:
        FileNotFoundError: there is no such file.
        ModelFileError: it is no environment model of this version.
    """
    if path is None:
        with as_file(files("rfgen_sionna.generative.environment") / "weights") as folder:
            return read_model(folder, control)
    file = path / BASE_FILE if path.is_dir() else path
    header, tensors = _read(file, FORMAT, "an environment model (training.environment.train makes one)")
    shape = UNetShape(**_tuples(header["shape"]))
    unet = shape.unet()
    vae = PatchAutoencoder(latent_channels=shape.latents)
    text = PlaceEncoder(header["places"], header["things"])
    for name, module in (("unet", unet), ("vae", vae), ("text", text)):
        found = {k[len(name) + 1 :]: v for k, v in tensors.items() if k.startswith(f"{name}.")}
        module.load_state_dict(found)
        module.eval().requires_grad_(False)
    known: Control | None = None
    if control:
        known = read_control(control if isinstance(control, Path) else file.with_name(CONTROL_FILE), unet)
    codec = PirCodec(**_tuples(header["codec"]))
    edge_smoothing = EdgePreservingSmoothing(**_tuples(header.get("polish", {})))
    tables = {k.removeprefix("expectation."): v.numpy() for k, v in tensors.items() if k.startswith("expectation.")}
    expected = ConditionalPrior.from_tables(tables, header["finishes"]) if tables else None
    model = EnvironmentModel(unet, vae, text, codec, shape, header["facts"], edge_smoothing, expected)
    if known is None:
        return model
    return replace(model, control=known.net, control_facts=known.facts, confidence_gate=known.confidence_gate)


def weights_fingerprint(unet: UNet2DConditionModel) -> str:
    """Fingerprint of a denoising network in half precision, as in its file."""
    return fingerprint(deepcopy(unet).half().float())


def read_control(path: Path, unet: UNet2DConditionModel, *, any_base: bool = False) -> Control:
    """ControlNet of `unet` from a file, or from a folder of diffusers, with its facts and gate.

    Args:
        path: file or folder; diffusers' folders and files of earlier versions do not name their base.
        unet: the base model's.
        any_base: whether to accept other weights of the same shape, as a start for training.

    Raises:
        FileNotFoundError: there is no such file.
        ModelFileError: it is no ControlNet of this base model.
    """
    if path.is_dir():
        if (path / CONTROL_FILE).is_file():
            return read_control(path / CONTROL_FILE, unet, any_base=any_base)
        return Control(ControlNetModel.from_pretrained(path).eval().requires_grad_(False), {}, ConfidenceGate())
    header, tensors = _read(path, CONTROL_FORMAT, "a ControlNet (training.environment.controlnet makes one)")
    control = new_control(unet)
    try:
        control.load_state_dict({k: v for k, v in tensors.items() if not k.startswith(GATE_PREFIX)})
    except RuntimeError as error:
        raise ModelFileError(
            f"control: {path.name} was trained on another base model; take the one beside it"
        ) from error
    facts: dict[str, Any] = header["facts"]
    if facts.get("base") and not any_base and facts["base"] != weights_fingerprint(unet):
        raise ModelFileError(
            f"control: {path.name} was trained on another base model: of the same shape, with other weights; take the "
            "one beside its base, or train one for this base with training.environment.controlnet"
        )
    gate_tensors = {k.removeprefix(GATE_PREFIX): v for k, v in tensors.items() if k.startswith(GATE_PREFIX)}
    return Control(control.eval().requires_grad_(False), facts, ConfidenceGate.of(header["share"], gate_tensors))


def _tuples(fields: dict[str, Any]) -> dict[str, Any]:
    return {k: tuple(v) if isinstance(v, list) else v for k, v in fields.items()}


def _read(path: Path, kind: str, what: str) -> tuple[dict[str, Any], dict[str, Tensor]]:
    if not path.is_file():
        raise FileNotFoundError(f"model: {path} is not there; expected {what}")
    try:
        with safe_open(path, "pt") as file:
            header = json.loads((file.metadata() or {}).get("rfgen", "{}"))
            found = header.get("format")
            tensors = {key: file.get_tensor(key).float() for key in file.keys()} if found == kind else {}  # noqa: SIM118
    except Exception as error:
        if isinstance(error, OSError):
            raise
        raise ModelFileError(f"model: {path.name} is no safetensors file: {error}") from error
    if found != kind:
        raise ModelFileError(f"model: {path.name} has format {found!r}; expected {what}")
    return header, tensors


def condition_of(channels: np.ndarray) -> Tensor:
    """(image, 3, row, column) ControlNet input in 0 … 1, from channels in −1 … 1."""
    return torch.from_numpy(np.ascontiguousarray(0.5 * (channels.astype(np.float32) + 1.0)))
