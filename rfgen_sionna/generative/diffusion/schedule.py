"""Forward process of the motion model, and its samplers from diffusers.

x_t = √a_t x_0 + √(1 − a_t) noise, a_t along a cosine (Nichol and Dhariwal 2021). Steps are even in u, t = 1 − (1 − u)²,
denser at high noise, where the rhythm is decided.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rfgen_sionna._types import FloatArray

STEPS = 1000
"""Steps of the forward process."""
SAMPLERS = ("ddim", "dpm")


def signal_shares() -> FloatArray:
    """(STEPS,) share a_t of the signal's power at each step."""
    u = (np.arange(STEPS) + 1.0) / STEPS
    t = 1.0 - (1.0 - u) ** 2
    shares = np.cos(0.5 * np.pi * (t + 0.008) / 1.008) ** 2 / np.cos(0.5 * np.pi * 0.008 / 1.008) ** 2
    # some signal is left at the top, for a finite logarithm
    return 2e-5 + (1.0 - 2e-5) * shares


def log_snr(shares: FloatArray) -> FloatArray:
    """ln of signal over noise power, from the signal's share."""
    return np.log(shares / (1.0 - shares))


def step_at(t: float) -> int:
    """Step with the noise of time `t` (0 .. 1) on the cosine."""
    return int(np.clip(round((1.0 - np.sqrt(max(1.0 - t, 0.0))) * STEPS) - 1, 0, STEPS - 1))


def make_scheduler(sampler: str = "ddim") -> Any:
    """Scheduler of diffusers (`DDIMScheduler` or `DPMSolverMultistepScheduler`) with this forward process.

    Args:
        sampler: one of `SAMPLERS`.

    Raises:
        ValueError: unknown sampler.
        ImportError: diffusers is not installed.
    """
    if sampler not in SAMPLERS:
        raise ValueError(f"sampler: {sampler!r}; allowed are {', '.join(SAMPLERS)}")
    try:
        from diffusers import DDIMScheduler, DPMSolverMultistepScheduler
    except ImportError as error:
        raise ImportError("the motion model needs diffusers: pip install 'rfgen-sionna[diffusion]'") from error
    shares = signal_shares()
    betas = 1.0 - shares / np.concatenate([[1.0], shares[:-1]])
    common: dict[str, Any] = {
        "num_train_timesteps": STEPS,
        "trained_betas": betas,
        "prediction_type": "sample",
        "timestep_spacing": "trailing",
    }
    if sampler == "ddim":
        return DDIMScheduler(clip_sample=False, set_alpha_to_one=True, **common)
    return DPMSolverMultistepScheduler(final_sigmas_type="zero", lower_order_final=True, **common)
