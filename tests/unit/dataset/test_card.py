"""The card says what is in a set."""

from rfgen_sionna.dataset.card import write_card
from tests.unit.dataset.small_sets import RECIPE, make_set


def test_a_card_counts_what_is_there(tmp_path):
    folder = make_set(tmp_path / "set", count=6)
    text = write_card(folder).read_text()
    assert text.startswith("# Two gestures\n")
    assert "6 recordings, 3 s, 30 frames" in text
    assert "2 actions, 2 places, 2 shards" in text
    assert "| push | 1 | 2 | 3 |" in text
    assert "| all | 2 | 4 | 6 |" in text
    assert "CC0-1.0" in text
    assert RECIPE.strip() in text
    assert "| `adc` | samples of the ADC |" in text
    assert "8 × 3 × 4 × 32" in text


def test_a_card_is_the_same_again_and_elsewhere(tmp_path):
    one, two = make_set(tmp_path / "one", count=3), make_set(tmp_path / "two", count=3)
    assert write_card(one).read_bytes() == write_card(two).read_bytes() == write_card(one).read_bytes()


def test_a_recipe_without_a_licence_says_so(tmp_path):
    folder = make_set(tmp_path / "set", count=1)
    (folder / "recipe.toml").write_text('prompts = ["```"]\n')
    text = write_card(folder).read_text()
    assert "The recipe names none" in text
    assert "````toml" in text
