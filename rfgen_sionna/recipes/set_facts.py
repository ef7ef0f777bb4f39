"""Facts of a data set that its shards and its index have: enough to repair what needs no new recording."""

from __future__ import annotations

import json
import logging
import platform
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from rfgen_sionna.dataset.card import CARD
from rfgen_sionna.dataset.schema import software_versions
from rfgen_sionna.dataset.store import OutputError
from rfgen_sionna.dataset.whole_files import write_whole
from rfgen_sionna.recipes.recipe import Recipe
from rfgen_sionna.recipes.recipe_error import RecipeError

RECIPE = "recipe.toml"
"""Name of the recipe in the folder of a set."""
AUGMENTATION = "augmentation"
"""Table in the recipe of a set that is derived from another one by :mod:`rfgen_sionna.recipes.augmentation`."""
ORIGIN = ".origin"
"""Name of the file with the folder of the recipe's own files on this machine."""
PROCESSOR = ".processor"
"""Name of the file with the kind of the processor that a build was begun on."""
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class SetFacts:
    """What a set has been made from."""

    text: str
    """The recipe (TOML)."""
    digest: str
    """SHA-256 of the recipe and its files."""
    count: int
    """Number of recordings."""
    recordings_per_shard: int
    software: str
    """Versions of the software (JSON)."""
    device: str = "cpu"
    """Device that sums the paths."""
    derived: str = ""
    """Of a set that is made from the recordings of another one: by what, and the digest of that one's recipe."""

    @classmethod
    def of(cls, recipe: Recipe, device: str = "cpu") -> SetFacts:
        """Facts of a new set."""
        software = json.dumps(software_versions(), sort_keys=True)
        text = with_plain_ends(recipe.text)
        return cls(text, recipe.digest, recipe.count, recipe.recordings_per_shard, software, device)

    @classmethod
    def stored(cls, attributes: Mapping[str, str], text: str) -> SetFacts | None:
        """Facts in the attributes of a shard or of an index; None where they lack."""
        try:
            numbers = int(attributes["recordings"]), int(attributes["recordings_per_shard"])
            device, derived = str(attributes.get("device", "cpu")), str(attributes.get("derived", ""))
            return cls(text, str(attributes["recipe_digest"]), *numbers, str(attributes["software"]), device, derived)
        except (KeyError, ValueError):
            return None

    @property
    def meta(self) -> dict[str, str]:
        """Facts for the index."""
        return {
            "recipe_digest": self.digest, "recordings": str(self.count),
            "recordings_per_shard": str(self.recordings_per_shard), "software": self.software, "device": self.device,
        } | ({"derived": self.derived} if self.derived else {})  # fmt: skip

    @property
    def attributes(self) -> dict[str, str]:
        """Attributes of the shards."""
        return {"recipe": self.text, **self.meta}

    def changes(self, begun: Mapping[str, str]) -> list[str]:
        """What is other than in the facts that a set was begun with, in words; its recordings would be others, too."""
        found = []
        if begun.get("recipe", self.text) != self.text:
            found.append(f"{RECIPE} was edited")
        elif begun.get("recipe_digest", self.digest) != self.digest:
            found.append("a file that the recipe names (mesh, clip, radar, receiver or scene) has other contents")
        if (device := begun.get("device", self.device)) != self.device:
            found.append(f"the device is {self.device} instead of {device} (gpus_per_worker, --gpus-per-worker)")
        here, there = json.loads(self.software), _versions(begun.get("software", self.software))
        for name in sorted(here.keys() | there.keys()):
            if here.get(name) != there.get(name):
                found.append(f"{name} is {here.get(name, 'missing')} instead of {there.get(name, 'missing')}")
        return found

    def check_unchanged(self, folder: Path, begun: Mapping[str, str]) -> None:
        """OutputError if recordings of these facts would be others than those in a folder."""
        if changes := self.changes(begun):
            raise OutputError(
                f"'{folder}' was begun with others, its recordings would differ: {'; '.join(changes)}. Take the old "
                "ones again, or build the recipe in another folder"
            )


def with_plain_ends(text: str) -> str:
    """A text whose lines end as those of a stored recipe do, on any system."""
    return text.replace("\r\n", "\n")


def _versions(text: str) -> dict[str, str]:
    try:
        return {str(name): str(version) for name, version in json.loads(text).items()}
    except (ValueError, AttributeError, RecursionError):
        return {}


def note_origin(folder: Path, recipe: str | PathLike[str]) -> None:
    """Note where the recipe of a set lies on this machine, beside its files."""
    write_whole(folder / ORIGIN, str(Path(recipe).resolve().parent))


def processor_name() -> str:
    """Kind of this processor."""
    with suppress(OSError, StopIteration):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return platform.processor() or platform.machine()


def note_processor(folder: Path) -> None:
    """Note the kind of this processor beside a set; a warning where the set was begun on another one."""
    noted, here = folder / PROCESSOR, processor_name()
    if not noted.is_file():
        write_whole(noted, here)
    elif (there := noted.read_text(encoding="utf-8", errors="replace")[:200]) != here:
        _LOG.warning(
            "'%s' was begun on '%s', and this is '%s': recordings have the same bits on processors of one kind", folder,
            there, here,
        )  # fmt: skip


def recipe_of_set(folder: Path, recipe: Recipe | str | PathLike[str] | None = None, text: str | None = None) -> Recipe:
    """The recipe of a set, with its files.

    Parameters
    ----------
    folder
        Folder of the set.
    recipe
        The recipe, or its file; None takes that of the set, with files beside its origin.
    text
        Text of the recipe; None reads it in the folder.

    Raises
    ------
    FileNotFoundError
        If the folder has no recipe.
    ValueError
        If the recipe is another one, its files are missing, or the set is derived from another one.
    """
    stored = folder / RECIPE
    if text is None and not stored.is_file():
        raise FileNotFoundError(f"'{folder}' has no {RECIPE}, so it is no data set; `rfgen dataset build` begins one")
    text = stored.read_text(encoding="utf-8") if text is None else text
    if f"\n[{AUGMENTATION}]\n" in text:
        raise ValueError(
            f"'{folder}' is derived from another set, and no recipe makes its recordings: augment_dataset(SOURCE, "
            f"'{folder}', variants_of('{folder}'), resume=True) makes those that are lost from that set, which {CARD} "
            "describes, in the folder SOURCE"
        )
    if recipe is not None:
        chosen = recipe if isinstance(recipe, Recipe) else Recipe.load(recipe)
        if with_plain_ends(chosen.text) != with_plain_ends(text):
            raise ValueError(f"recipe is another one than that of '{folder}': give the one that the set was made from")
        return chosen
    origin = folder / ORIGIN
    beside = Path(origin.read_text(encoding="utf-8")) if origin.is_file() else folder
    try:
        return Recipe.parse(text, beside)
    except RecipeError as error:
        raise RecipeError(
            f"{error}. Where the recipe's files lie beside the recipe that the set was built from, give that one: "
            "recipe=…, or --recipe FILE"
        ) from None
