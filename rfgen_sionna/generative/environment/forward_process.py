"""The forward process: how noise is laid on latents."""

from __future__ import annotations

from diffusers import DDIMScheduler
from torch import Tensor


def make_scheduler() -> DDIMScheduler:
    """The forward process and its sampler: v-prediction, scaled-linear betas, no signal at all in the last step."""
    return DDIMScheduler(
        num_train_timesteps=1000,
        beta_start=0.00085,
        beta_end=0.012,
        beta_schedule="scaled_linear",
        prediction_type="v_prediction",
        rescale_betas_zero_snr=True,
        timestep_spacing="trailing",
        set_alpha_to_one=True,
        clip_sample=False,
        steps_offset=1,
    )


_SHARES: Tensor = make_scheduler().alphas_cumprod
"""(step,) of the latents' energy that is left."""


def signal_and_noise(steps: Tensor) -> tuple[Tensor, Tensor]:
    """(image, 1, 1, 1) factors of latents and of noise at time steps (image,)."""
    share = _SHARES.to(steps.device)[steps.long()][:, None, None, None]
    return share.sqrt(), (1.0 - share).sqrt()
