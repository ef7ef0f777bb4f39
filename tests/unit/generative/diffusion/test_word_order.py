"""Whose side is whose, and from where to where, is told by the order of words."""

from __future__ import annotations

import pytest

from rfgen_sionna.generative.diffusion.understanding import (
    action_by_word_order,
    direction_named,
    hand_named,
    understand,
)


@pytest.mark.parametrize(
    ("prompt", "hand", "way"),
    [
        ("a man sweeps the hand to the left with the right hand", "right", "left"),
        ("brush something away rightwards, facing left", "", "right"),
        ("she swipes the left hand from left to right in front of the radar", "left", "right"),
        ("swiping from right to left right in front of the sensor", "", "left"),
        ("swipes the left-hand side clean with the right palm", "right", ""),
        ("both ways: left and right", "", ""),
        ("a person swipes", "", ""),
    ],
)
def test_sides(prompt: str, hand: str, way: str) -> None:
    assert direction_named(prompt) == way
    if "side" not in prompt:
        assert hand_named(prompt) == hand


@pytest.mark.parametrize(
    ("likeliest", "prompt", "told"),
    [
        ("swipe_right", "swiping to the left", "swipe_left"),
        ("swipe_right", "swiping", ""),
        ("right_arm_raised", "he keeps his left arm lifted", "left_arm_raised"),
        ("right_leg_raised", "she balances on the left leg", ""),
        ("push", "moves the hand from the front to the chest", "pull"),
        ("pull", "moves the hand from the chest to the front", "push"),
        ("push", "moves the hand from the chest and back to the chest", ""),
        ("walk", "a woman walks forward in a straight line", "walk_straight"),
        ("walk", "walks straight ahead and back again", ""),
        ("idle", "somebody stands", "standing"),
        ("walk", "wave a finger sideways", "click"),
        ("jump", "jumps to the left", ""),
    ],
)
def test_what_the_order_tells(likeliest: str, prompt: str, told: str) -> None:
    shares = dict.fromkeys(("swipe_left", "swipe_right", "push", "pull", "click", "finger_swing"), 0.01)
    shares["click"] = 0.02
    assert action_by_word_order(prompt, shares | {likeliest: 0.6}) == told


def test_the_shipped_encoder_is_put_right() -> None:
    from rfgen_sionna.generative.diffusion.diffusion_source import DiffusionSource

    model = DiffusionSource().model
    said = understand(model.text, "a person swiping the hand to the left with the right hand", model.stems)
    assert (said.action, said.hand, said.options) == ("swipe_left", "right", ("swipe_left",))
    # what is open stays open
    assert len(understand(model.text, "a person makes a swipe gesture", model.stems).alternatives) == 2
