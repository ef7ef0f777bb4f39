"""What the network is told of a view is what follows from it, and reaches the picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.generative.environment.environment_model import EnvironmentModel, new_control
from rfgen_sionna.generative.environment.place_encoder import ViewFacts, view_tokens
from rfgen_sionna.generative.environment.view_unet import (
    MAPS,
    WALLS,
    decode_view_tokens,
    upright_view_tokens,
    view_maps,
)
from rfgen_sionna.pir.codec import PirCodec
from rfgen_sionna.pir.view import View
from training.environment.view_corpus import mirrored_facts

FACTS = ViewFacts((80.0, 60.0), 1.4, 0.2, -2.1, 0.1)
EVEN = replace(FACTS, fov_deg=(150.0, 100.0), roll=1.2, projection="equirectangular")


def channel(distance: np.ndarray) -> np.ndarray:
    """What the codec makes of ranges (pixel,)."""
    row = distance[None]
    return PirCodec().encode_arrays(np.full_like(row, 1e-10), 2 * row / SPEED_OF_LIGHT, 0 * row, clip=True)[1, 0]


def test_the_token_of_numbers_is_read_back() -> None:
    views = [FACTS, mirrored_facts(FACTS), EVEN, mirrored_facts(EVEN)]
    token = view_tokens(views)[:, 0]
    np.testing.assert_allclose(decode_view_tokens(token), [view.numbers for view in views], atol=1e-5)
    np.testing.assert_allclose(decode_view_tokens(token.bfloat16())[0], FACTS.numbers, atol=0.01)


def test_networks_are_told_of_level_perspective_views_in_words() -> None:
    """What they never saw comes by the maps; views that they saw come as they are."""
    level = replace(FACTS, roll=0.0)
    told = view_tokens([level, FACTS, replace(level, projection="equirectangular")])
    assert torch.equal(upright_view_tokens(told)[0], told[0])
    torch.testing.assert_close(upright_view_tokens(told)[1:], told[:1].expand(2, -1, -1))
    assert torch.abs(told[1:] - told[:1]).amax() > 0.1


@pytest.mark.parametrize("facts", [FACTS, EVEN, replace(EVEN, fov_deg=(280.0, 160.0))])
def test_maps_are_directions_and_the_ranges_of_floor_and_walls(facts: ViewFacts) -> None:
    maps = view_maps(view_tokens([facts])[:, 0], 32, 64)[0].numpy()
    assert maps.shape == (MAPS, 32, 64)
    view = View(
        (32, 64), facts.fov_deg, (0.0, 0.0, facts.height), (facts.yaw, facts.pitch, facts.roll), facts.projection
    )
    x, y, z = np.moveaxis(view.directions, -1, 0)
    np.testing.assert_allclose(maps[:3], [x, y, z], atol=1e-5)
    below = z < -0.05
    np.testing.assert_allclose(maps[3][below], channel(-facts.height / z[below]), atol=1e-4)
    assert (maps[3][z > 0] == 1.0).all()
    for k, distance in enumerate(WALLS):
        for axis, part in ((5 + k, x), (5 + len(WALLS) + k, y)):
            seen = np.abs(part) > 0.2
            np.testing.assert_allclose(maps[axis][seen], channel(distance / np.abs(part[seen])), atol=1e-4)


def test_a_view_has_a_say_once_that_is_learnt_and_a_controlnet_can_be_made(model: EnvironmentModel) -> None:
    unet = model.shape.unet().eval()
    noise = torch.randn(1, 32, 16, 16, generator=torch.Generator().manual_seed(0))
    here, there = (model.text.embed(["a lab"], [facts]) for facts in (FACTS, mirrored_facts(FACTS)))
    here[:, 1:], there[:, 1:] = 0.0, 0.0
    with torch.no_grad():
        upright_view_tokens = unet(noise, 500, here).sample
        torch.nn.init.normal_(unet.view_in.weight, std=0.1)
        assert torch.abs(unet(noise, 500, here).sample - upright_view_tokens).max() > 1e-2
        assert unet.conv_in.added is None
    control = new_control(unet)
    assert torch.equal(control.conv_in.weight, unet.conv_in.weight)
