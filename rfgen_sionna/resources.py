"""Paths of the shipped radars and scenes: in the package's `_data` folder of a wheel, at the top of a checkout."""

from __future__ import annotations

from difflib import get_close_matches
from pathlib import Path

_FILES = {"radars": "*.toml", "scenes": "*/scene.xml"}
"""Kind -> pattern of its files."""


class UnknownResourceError(ValueError):
    """No shipped radar or scene has this name."""


def available(kind: str) -> tuple[str, ...]:
    """Sorted names of the shipped resources of a kind, "radars" or "scenes"; another kind is a ValueError."""
    return tuple(sorted(_files(kind)))


def resolve(kind: str, name: str) -> Path:
    """Path of a named resource: `radars/<name>.toml` or `scenes/<name>/scene.xml`.

    Raises
    ------
    UnknownResourceError
        Unknown name; the message lists the known ones.
    ValueError
        `kind` is neither "radars" nor "scenes".
    """
    files = _files(kind)
    if name in files:
        return files[name]
    close = get_close_matches(name, files, n=1)
    hint = f" (did you mean {close[0]!r}?)" if close else ""
    raise UnknownResourceError(
        f"no {kind.removesuffix('s')} is called {name!r}{hint}; available: {', '.join(sorted(files))}"
    )


def _files(kind: str) -> dict[str, Path]:
    if kind not in _FILES:
        raise ValueError(f"kind: {kind!r} given, allowed are {', '.join(map(repr, _FILES))}")
    package = Path(__file__).resolve().parent
    for folder in (package / "_data" / kind, package.parent / kind):
        if folder.is_dir():
            return {
                path.stem if path.parent == folder else path.parent.name: path for path in folder.glob(_FILES[kind])
            }
    return {}
