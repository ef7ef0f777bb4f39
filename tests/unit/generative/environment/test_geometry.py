"""What the network is told of a view is what follows from it, and reaches the picture."""

from __future__ import annotations

import numpy as np
import torch

from rfgen_sionna.generative.environment.geometry import MAPS, WALLS, numbers_of, view_maps
from rfgen_sionna.generative.environment.model import EnvironmentModel, new_control
from rfgen_sionna.generative.environment.text import ViewFacts, view_tokens
from rfgen_sionna.pir.codec import PirCodec
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import SPEED_OF_LIGHT

FACTS = ViewFacts((80.0, 60.0), 1.4, 0.2, -2.1, 0.1)


def channel(distance: np.ndarray) -> np.ndarray:
    """What the codec makes of ranges (pixel,)."""
    row = distance[None]
    return PirCodec().encode_arrays(np.full_like(row, 1e-10), 2 * row / SPEED_OF_LIGHT, 0 * row, clip=True)[1, 0]


def test_the_token_of_numbers_is_read_back() -> None:
    token = view_tokens([FACTS, FACTS.mirrored()])[:, 0]
    np.testing.assert_allclose(numbers_of(token), [FACTS.numbers, FACTS.mirrored().numbers], atol=1e-5)
    np.testing.assert_allclose(numbers_of(token.bfloat16())[0], FACTS.numbers, atol=0.01)


def test_maps_are_directions_and_the_ranges_of_floor_and_walls() -> None:
    maps = view_maps(view_tokens([FACTS])[:, 0], 32, 64)[0].numpy()
    assert maps.shape == (MAPS, 32, 64)
    view = View((32, 64), FACTS.fov_deg, (0.0, 0.0, FACTS.height), (FACTS.yaw, FACTS.pitch, FACTS.roll))
    x, y, z = np.moveaxis(view.directions, -1, 0)
    np.testing.assert_allclose(maps[:3], [x, y, z], atol=1e-5)
    below = z < -0.05
    np.testing.assert_allclose(maps[3][below], channel(-FACTS.height / z[below]), atol=1e-4)
    assert (maps[3][z > 0] == 1.0).all()
    for k, distance in enumerate(WALLS):
        for axis, part in ((5 + k, x), (5 + len(WALLS) + k, y)):
            seen = np.abs(part) > 0.2
            np.testing.assert_allclose(maps[axis][seen], channel(distance / np.abs(part[seen])), atol=1e-4)


def test_a_view_has_a_say_once_that_is_learnt_and_a_controlnet_can_be_made(model: EnvironmentModel) -> None:
    unet = model.shape.unet().eval()
    noise = torch.randn(1, 32, 16, 16, generator=torch.Generator().manual_seed(0))
    here, there = (model.text.embed(["a lab"], [facts]) for facts in (FACTS, FACTS.mirrored()))
    here[:, 1:], there[:, 1:] = 0.0, 0.0
    with torch.no_grad():
        plain = unet(noise, 500, here).sample
        torch.nn.init.normal_(unet.view_in.weight, std=0.1)
        assert torch.abs(unet(noise, 500, here).sample - plain).max() > 1e-2
        assert unet.conv_in.added is None
    control = new_control(unet)
    assert torch.equal(control.conv_in.weight, unet.conv_in.weight)
