"""RF LoRA: low-rank adapters of an image model's attention, their files, and fingerprints of their bases."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import torch
from safetensors import safe_open
from safetensors.torch import load_file
from torch import Tensor, nn

FORMAT = "rfgen-lora-1"
WEIGHT_NAME = "pytorch_lora_weights.safetensors"
"""File name of diffusers."""
_DOWN = re.compile(r"^(?P<layer>.+?)\.(?:lora_A|lora\.down|processor\.(?P<part>\w+)_lora\.down)(?:\.\w+)?\.weight$")


class LoraError(ValueError):
    """A LoRA is unreadable, or belongs to another base."""


@dataclass(frozen=True)
class LoraFacts:
    """Metadata of a LoRA file."""

    codec: str = "rfgen"
    base: str = ""
    """Name of the base model in training."""
    steps: int = 0
    rate: float = 0.0
    seed: int = 0
    word: str = ""
    """First word of prompts, or empty."""
    weights: str = ""
    """Fingerprint of the base's U-Net; empty where unknown."""


def find_lora(source: str | Path) -> Path:
    """File of a LoRA: a path, the file in a folder, or in a repository of the hub.

    Raises:
        LoraError: there is none.
    """
    path = Path(source)
    if path.is_file():
        if path.suffix != ".safetensors":
            raise LoraError(f"lora: {path.name} is no .safetensors file; others may run code when they are read")
        return path
    if path.is_dir():
        found = sorted(path.glob("*.safetensors"))
        if (path / WEIGHT_NAME) in found:
            return path / WEIGHT_NAME
        if len(found) != 1:
            names = ", ".join(f.name for f in found) or "none"
            raise LoraError(f"lora: {path} holds {len(found)} .safetensors files ({names}); name the one that is meant")
        return found[0]
    if re.fullmatch(r"[\w.-]+/[\w.-]+", str(source)):
        return _from_hub(str(source))
    raise LoraError(f"lora: {source} is no file, no folder and no hub name (owner/name)")


def _from_hub(name: str) -> Path:
    from huggingface_hub import hf_hub_download, list_repo_files

    try:
        files = [f for f in list_repo_files(name) if f.endswith(".safetensors")]
        if len(files) != 1 and WEIGHT_NAME in files:
            files = [WEIGHT_NAME]
        if len(files) != 1:
            raise LoraError(f"lora: {name} holds {files}; download the one that is meant and give its path")
        return Path(hf_hub_download(name, files[0]))
    except LoraError:
        raise
    except Exception as error:
        raise LoraError(
            f"lora: {name} could not be fetched from the hub ({type(error).__name__}); check the name and the network, "
            "or download it elsewhere and give its path"
        ) from error


def read_facts(path: Path) -> LoraFacts:
    """Metadata of a LoRA file. Files without metadata of this package follow the paper authors' image convention.

    Raises:
        LoraError: it is no safetensors file.
    """
    try:
        with safe_open(path, "pt") as file:
            header: dict[str, Any] = json.loads((file.metadata() or {}).get("rfgen", "{}"))
    except OSError:
        raise
    except Exception as error:
        raise LoraError(f"lora: {path.name} is no safetensors file: {error}") from error
    if header.pop("format", None) != FORMAT:
        return LoraFacts(codec="authors")
    return LoraFacts(**{k: v for k, v in header.items() if k in LoraFacts.__dataclass_fields__})


def check_fits(state: dict[str, Tensor], net: nn.Module, name: str, prefix: str = "unet") -> None:
    """Compare a LoRA's layers (diffusers' names, under `prefix`) with those of its base.

    Raises:
        LoraError: a layer is missing or of another size, its values are not finite, or naming schemes are mixed.
    """
    own = [key for key in state if key.startswith(f"{prefix}.") and _DOWN.match(key[len(prefix) + 1 :])]
    if len({".lora_A." in key for key in own}) > 1:
        raise LoraError(f"lora: {name} mixes old and new names of layers; train it again")
    modules = dict(net.named_modules())
    checked = 0
    for key, weight in state.items():
        if not key.startswith(f"{prefix}."):
            continue
        match = _DOWN.match(key[len(prefix) + 1 :])
        if match is None:
            continue
        where = match["layer"]
        if match["part"]:  # older naming
            where += ".to_out.0" if match["part"] == "to_out" else f".{match['part']}"
        layer = modules.get(where)
        if layer is None:
            raise LoraError(
                f"lora: {name} was trained on another base: this one has no layer {where}; take the LoRA's own base"
            )
        partner = state.get(_up(key))
        if partner is None:
            raise LoraError(f"lora: {name} is incomplete: {key} has no second half; download or train it again")
        there = tuple(_size(layer, side) for side in ("in", "out"))
        if there != (wanted := (weight.shape[1], partner.shape[0])) or partner.shape[1] != weight.shape[0]:
            raise LoraError(
                f"lora: {name} was trained on another base: {where} takes {wanted[0]} inputs to {wanted[1]} there and "
                f"{there[0]} to {there[1]} here; take the LoRA's own base"
            )
        if not (torch.isfinite(weight).all() and torch.isfinite(partner).all()):
            raise LoraError(f"lora: {name} holds values that are not finite in {where}; train it again")
        checked += 1
    if not checked:
        raise LoraError(f"lora: {name} holds no LoRA of a U-Net (no layers under {prefix!r})")


def _up(key: str) -> str:
    """Name of the up-projection that belongs to the down-projection `key`."""
    return key.replace(".lora_A", ".lora_B").replace("lora.down", "lora.up")


def _size(layer: nn.Module, side: str) -> int | None:
    """Number of inputs ("in") or outputs ("out") of a layer."""
    return getattr(layer, f"{side}_features", getattr(layer, f"{side}_channels", None))


def load_lora(unet: Any, source: str | Path) -> LoraFacts:
    """Merge a LoRA of the embedded model into its U-Net, in place.

    Raises:
        LoraError: it is missing or unreadable, or belongs to another base.
    """
    path = find_lora(source)
    facts = read_facts(path)
    state = load_file(path)
    check_fits(state, unet, path.name)
    if facts.weights and facts.weights != fingerprint(unet):
        raise LoraError(
            f"lora: {path.name} was trained on another base: the weights of {facts.base!r} differ; take the "
            "LoRA's own base, or train it again"
        )
    layers = {k: v.to(next(unet.parameters()).dtype) for k, v in state.items() if k.startswith("unet.")}
    unet.load_lora_adapter(layers, prefix="unet", adapter_name="rf")
    unet.fuse_lora()
    unet.unload_lora()
    return facts


def fingerprint(net: torch.nn.Module | None) -> str:
    """Hash of a network's weights, 16 hexadecimal digits; empty for None."""
    if net is None:
        return ""
    digest = sha256()
    for name, values in sorted(net.state_dict().items()):
        digest.update(name.encode())
        digest.update(values.detach().cpu().double().numpy().tobytes())
    return digest.hexdigest()[:16]
