"""Fingerprints of weights: LoRAs and ControlNets fit the weights that they were trained on alone."""

from __future__ import annotations

from hashlib import sha256

import torch


def fingerprint(net: torch.nn.Module | None) -> str:
    """Hash of a network's weights, 16 hexadecimal digits; without a network empty."""
    if net is None:
        return ""
    told = sha256()
    for name, values in sorted(net.state_dict().items()):
        told.update(name.encode())
        told.update(values.detach().cpu().double().numpy().tobytes())
    return told.hexdigest()[:16]
