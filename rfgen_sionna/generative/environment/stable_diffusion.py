"""Stable Diffusion bases: pictures from prompts, converted to PIRs by the convention of their RF LoRA."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors.torch import load_file

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.environment.adapters import LoraError, LoraFacts, check_fits, find_lora, read_facts
from rfgen_sionna.generative.environment.image_sampling import DrawingOptions, Progress
from rfgen_sionna.generative.environment.reprojection import NATIVE, empty_pir
from rfgen_sionna.generative.environment.torch_device import memory_errors, precision
from rfgen_sionna.pir.codec import AuthorsCodec, PirCodec
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import Pir

FOV_DEG = 60.0
"""Field of view of the paper's images, square."""
_AROUND = 0.75
"""Strength of drawing over a reprojected view; keeps its layout."""


class ModelError(ValueError):
    """A Stable Diffusion base is unavailable."""


def load_pipeline(name: str, dtype: torch.dtype) -> Any:
    """diffusers' text-to-image pipeline of a local folder or a hub name.

    Raises:
        ModelError: neither is available.
    """
    from diffusers import AutoPipelineForText2Image

    try:
        pipeline = AutoPipelineForText2Image.from_pretrained(name, torch_dtype=dtype)
    except Exception as error:
        where = (
            "the folder is no diffusers pipeline" if Path(name).is_dir() else "it is no folder here, and the hub gave"
        )
        raise ModelError(
            f"model: {name!r} could not be loaded: {where} ({type(error).__name__}: {_first_line(error)}); "
            "give the path of a downloaded pipeline (a folder with model_index.json), or a hub name and a network"
        ) from error
    if hasattr(pipeline, "safety_checker"):
        pipeline.safety_checker = None  # for photographs only
    pipeline.set_progress_bar_config(disable=True)
    return pipeline


def load_lora_into(pipeline: Any, source: str | Path) -> LoraFacts:
    """Merge a LoRA (diffusers' or kohya's names) into a pipeline.

    Raises:
        LoraError: it is missing or unreadable, or belongs to another base.
    """
    path = find_lora(source)
    facts = read_facts(path)
    try:
        converted = pipeline.lora_state_dict(load_file(path), unet_config=pipeline.unet.config)
    except TypeError:
        converted = pipeline.lora_state_dict(load_file(path))
    except (ValueError, KeyError) as error:
        raise LoraError(f"lora: {path.name} has weights that diffusers cannot convert: {error}") from error
    check_fits(converted[0], pipeline.unet, path.name)
    try:
        pipeline.load_lora_weights(str(path.parent), weight_name=path.name)
    except (RuntimeError, ValueError) as error:
        raise LoraError(f"lora: {path.name} was trained on another base: {_first_line(error)}") from error
    pipeline.fuse_lora()
    pipeline.unload_lora_weights()
    return facts


class StableDiffusionModel:
    """Backend of a Stable Diffusion base and its RF LoRA.

    Args:
        name: folder or hub name of the base.
        lora: RF LoRA; None draws with the base alone, for bases trained on PIRs.
        device: device of the pipeline.
        half, compiled: whether to compute in half precision (None: on CUDA only), whether to compile the network.

    Raises:
        ModelError, LoraError: base or LoRA are unavailable or do not fit.
    """

    def __init__(
        self, name: str, lora: str | Path | None, device: str, *, half: bool | None = None, compiled: bool = False
    ) -> None:
        self.pipeline = load_pipeline(name, precision(device, half))
        facts = LoraFacts() if lora is None else load_lora_into(self.pipeline, lora)
        self.facts = facts
        self.codec: PirCodec | AuthorsCodec = AuthorsCodec() if facts.codec == "authors" else PirCodec()
        with memory_errors(device):
            self.pipeline.to(device)
        if compiled:
            self.pipeline.unet.compile()

    def check_view(self, view: View) -> None:
        """Raise a ValueError for views other than the paper's."""
        if view.projection != "perspective":
            raise ValueError(
                f"projection: {view.projection!r}; images of a Stable Diffusion base are in perspective, the embedded "
                "model draws others"
            )
        if any(abs(angle - FOV_DEG) > 0.5 for angle in view.fov_deg):
            raise ValueError(
                f"fov_deg: {view.fov_deg[0]:.4g} × {view.fov_deg[1]:.4g} degrees; images of a Stable Diffusion base "
                f"show {FOV_DEG:g} × {FOV_DEG:g}; the embedded model draws others"
            )

    def draw(self, prompts: Sequence[str], seeds: Sequence[int], options: DrawingOptions) -> list[Pir]:
        """Static PIRs of one view, drawn one by one: one image fills a device."""
        return [self._draw(prompt, seed, options) for prompt, seed in zip(prompts, seeds, strict=True)]

    def _draw(self, prompt: str, seed: int, options: DrawingOptions) -> Pir:
        sampler, known, progress = options.sampler, options.known, options.progress
        pipe = self.pipeline
        words = f"{self.facts.word} {prompt}".strip()
        settings: dict[str, Any] = {
            "prompt": words,
            "negative_prompt": options.negative or None,
            "num_inference_steps": sampler.steps,
            "guidance_scale": sampler.guidance,
            "generator": torch.Generator().manual_seed(seed),
            "output_type": "np",
        }
        if progress is not None:
            settings["callback_on_step_end"] = _reporter(progress, sampler.steps)
        pipe.scheduler = sampler.scheduler(pipe.scheduler)
        like = empty_pir(options.view, np.zeros(NATIVE), np.zeros(NATIVE))
        with memory_errors(str(pipe.device)):
            if known is not None:
                from diffusers import AutoPipelineForImage2Image

                pipe = AutoPipelineForImage2Image.from_pipe(pipe)
                pipe.set_progress_bar_config(disable=True)
                picture = torch.from_numpy(self.codec.encode(known.pir, clip=True))[None] * 0.5 + 0.5
                size = pipe.unet.config.sample_size * pipe.vae_scale_factor
                settings["image"] = torch.nn.functional.interpolate(picture, size=(size, size), mode="nearest")
                settings["strength"] = _AROUND
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DeprecationWarning)
                image = pipe(**settings).images[0]
        channels = _shrunk(np.asarray(image, dtype=np.float64).transpose(2, 0, 1)) * 2 - 1
        pir = self.codec.decode(channels, like, clip=True)
        if known is not None:
            keep = np.kron(known.patches, np.ones(np.array(NATIVE) // known.patches.shape, dtype=np.bool_))
            pir = replace(
                pir,
                energy=np.where(keep, known.pir.energy, pir.energy),
                time_of_arrival=np.where(keep, known.pir.time_of_arrival, pir.time_of_arrival),
            )
        return replace(pir, velocity=np.zeros(NATIVE))


def _shrunk(image: FloatArray) -> FloatArray:
    """(3, 64, 64) medians of the blocks of a larger picture, which keep edges; nearest pixels for other ratios."""
    channels, rows, columns = image.shape
    if rows % NATIVE[0] or columns % NATIVE[1]:
        row, column = (
            ((np.arange(n) + 0.5) * size / n).astype(np.intp) for n, size in zip(NATIVE, (rows, columns), strict=True)
        )
        return np.asarray(image[:, row[:, None], column])
    blocks = image.reshape(channels, NATIVE[0], rows // NATIVE[0], NATIVE[1], columns // NATIVE[1])
    return np.asarray(np.median(blocks, axis=(2, 4)))


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [""])[0][:200]


def _reporter(progress: Progress, steps: int) -> Any:
    def report(_: Any, step: int, __: Any, state: dict[str, Any]) -> dict[str, Any]:
        progress(step + 1, steps)
        return state

    return report
