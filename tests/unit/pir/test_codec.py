"""Laws of the image conventions: decoding inverts encoding, and what an image can't hold is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.pir.codec import AuthorsCodec, ImageRangeError, PirCodec, check_image
from rfgen_sionna.records import Pir

CODEC = PirCodec()


def pir(energy: list[list[float]], distance: list[list[float]], velocity: list[list[float]]) -> Pir:
    power, reach = np.array(energy), np.array(distance)
    return Pir(
        power,
        np.where(power > 0, 2 * reach / SPEED_OF_LIGHT, np.nan),
        np.array(velocity),
        (60.0, 60.0),
        (0.0, 0.0, 1.0),
        (0.3, -0.2, 0.0),
        time=0.4,
    )


@given(
    st.floats(-180, -50), st.floats(0.0, 120.0), st.floats(-20.0, 20.0), st.booleans()
)  # the convention's whole range
def test_decoding_inverts_encoding(level: float, distance: float, speed: float, there: bool) -> None:
    power = 10 ** (level / 10) * 0.9999999 if there else 0.0
    image = pir([[power, 1e-9]], [[distance, 3.0]], [[speed, 0.0]])
    back = CODEC.decode(CODEC.encode(image), image)
    assert (back.energy[0, 0] > 0) == there
    assert (back.fov_deg, back.position, back.orientation, back.time) == (
        (60.0, 60.0),
        (0.0, 0.0, 1.0),
        (0.3, -0.2, 0.0),
        0.4,
    )
    if there:
        assert abs(10 * np.log10(back.energy[0, 0]) - level) < 1e-4
        assert abs(0.5 * SPEED_OF_LIGHT * back.time_of_arrival[0, 0] - distance) < 1e-5 * (distance + CODEC.knee)
        assert abs(back.velocity[0, 0] - speed) < 1e-4 * CODEC.max_speed
    else:
        assert np.isnan(back.time_of_arrival[0, 0])
        assert back.velocity[0, 0] == 0.0


def test_a_thousandth_of_the_channel_is_little_in_physical_units() -> None:
    image = pir([[1e-9, 1e-9]], [[3.0, 8.0]], [[0.0, 0.0]])
    off = CODEC.decode(CODEC.encode(image) + np.float32(0.001), image)
    assert np.abs(10 * np.log10(off.energy / image.energy)).max() < 0.07
    assert np.abs(off.time_of_arrival - image.time_of_arrival).max() * SPEED_OF_LIGHT / 2 < 0.025


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64])
def test_what_stands_still_does_so_when_its_image_was_stored(kind: type) -> None:
    image = pir([[1e-9, 1e-9, 1e-9]], [[3.0, 3.0, 3.0]], [[0.0, 1e-3, -1e-3]])
    still, there, back = CODEC.decode(CODEC.encode(image).astype(kind), image).velocity[0]
    assert still == 0.0
    assert [there, back] == pytest.approx([1e-3, -1e-3], rel=0.1)


def test_weak_energies_become_the_floor() -> None:
    image = pir([[1e-22]], [[3.0]], [[0.0]])
    assert CODEC.decode(CODEC.encode(image), image).energy[0, 0] == pytest.approx(1e-18)


@pytest.mark.parametrize(
    ("energy", "distance", "speed", "name"),
    [(1e-3, 3.0, 0.0, "energy"), (1e-9, 130.0, 0.0, "range"), (1e-9, 3.0, -21.0, "velocity")],
)
def test_what_images_cannot_hold_is_refused_or_clipped(energy: float, distance: float, speed: float, name: str) -> None:
    image = pir([[energy]], [[distance]], [[speed]])
    with pytest.raises(ImageRangeError, match=name):
        CODEC.encode(image)
    assert np.abs(CODEC.encode(image, clip=True)).max() <= 1.0


@pytest.mark.parametrize(
    ("image", "says"),
    [
        (np.full((3, 4, 4), 1.5), "2 v − 1"),
        (np.full((3, 4, 4), 255, np.uint8), "127.5"),
        (np.full((3, 4, 4), np.nan), "not finite"),
        (np.zeros((4, 4, 3)), "three channels"),
        (np.full((3, 4, 4), -3.0), "−3|-3"),
    ],
)
def test_images_of_another_range_are_refused(image: np.ndarray, says: str) -> None:
    with pytest.raises(ImageRangeError, match=says):
        check_image(image)


def test_the_authors_depth_is_along_the_line_of_sight_and_green_is_amplitude() -> None:
    like = pir([[1.0] * 2] * 2, [[1.0] * 2] * 2, [[0.0] * 2] * 2)
    image = np.full((3, 2, 2), -1.0)
    image[0], image[1] = 0.0, 0.0  # half of red and green
    got = AuthorsCodec().decode(image, like)
    # the pixels' middles stand at tan(30°)/2 to the side and above
    slant = np.sqrt(1 + 2 * (np.tan(np.radians(30)) / 2) ** 2)
    assert got.time_of_arrival * SPEED_OF_LIGHT / 2 == pytest.approx(np.full((2, 2), 7.5 * slant))
    assert got.energy == pytest.approx(np.full((2, 2), 1e-8 / 4))
    again = AuthorsCodec().encode(got)
    assert again[:2] == pytest.approx(image[:2], abs=1e-6)


def test_the_authors_pictures_hold_five_to_ten_metres() -> None:
    like = pir([[1e-9]], [[12.0]], [[0.0]])
    with pytest.raises(ImageRangeError, match="depth"):
        AuthorsCodec().encode(like)
    with pytest.raises(ValueError, match="projection is 'equirectangular'"):
        AuthorsCodec().encode(replace(like, projection="equirectangular"))
    near = replace(like, time_of_arrival=np.array([[2 * 7.0 / SPEED_OF_LIGHT]]))
    assert AuthorsCodec().decode(AuthorsCodec().encode(near), near).time_of_arrival == pytest.approx(
        near.time_of_arrival
    )
