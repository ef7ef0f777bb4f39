"""Comparison of a sidecar with the configuration files of the board's own tools."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Any

from rfgen_sionna.signal.formats.capture import CaptureFormatError
from rfgen_sionna.signal.formats.files import read_json, warn_or_raise

_ROUNDING = 1e-9  # relative difference of equal numbers in the text of two tools


def check_json(path: Path, wanted: dict[str, Any], fields: Collection[str], sidecar: Path, partial: bool) -> None:
    """Compare `fields`, at any depth of a JSON file, with `wanted`, the configuration that the sidecar gives.

    Raises
    ------
    CaptureFormatError
        Naming the first field that differs or is missing; with `partial` it is a warning, and the sidecar counts.
    """
    if not path.is_file():
        return
    try:
        found = read_json(path)
    except CaptureFormatError as error:
        warn_or_raise(str(error), partial)
        return
    leaves = ((field, value) for name, field, value in _json_leaves(wanted) if not name or name in fields)
    _compare(path, leaves, {field: value for _, field, value in _json_leaves(found)}, sidecar, partial)


def check_xml(path: Path, wanted: bytes, ignored: Collection[str], sidecar: Path, partial: bool) -> None:
    """:func:`check_json` for an XML file: all elements and attributes of `wanted` that are not `ignored`."""
    if not path.is_file():
        return
    try:
        found = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, LookupError, ValueError) as error:  # the last two: unknown encodings
        warn_or_raise(f"'{path}' is not XML: {error}", partial)
        return
    leaves = (
        (field, value) for name, field, value in _xml_leaves(ElementTree.fromstring(wanted)) if name not in ignored
    )
    _compare(path, leaves, {field: value for _, field, value in _xml_leaves(found)}, sidecar, partial)


def _compare(
    path: Path, wanted: Iterable[tuple[str, Any]], found: dict[str, Any], sidecar: Path, partial: bool
) -> None:
    for field, value in wanted:
        if not _same(value, found.get(field)):
            state = "is missing" if found.get(field) is None else f"is {found[field]!r}"
            warn_or_raise(f"'{path}': {field} {state}; {value!r} by '{sidecar.name}' beside it", partial)
            return


def _json_leaves(value: Any, name: str = "", path: str = "") -> Iterator[tuple[str, str, Any]]:
    """Name, path and value of every entry; without a name, the length of every list."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _json_leaves(inner, key, f"{path}.{key}" if path else key)
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from _json_leaves(inner, name, f"{path}[{index}]")
        yield "", f"the number of {path}", len(value)
    else:
        yield name, path, value


def _xml_leaves(element: Any, path: str = "") -> Iterator[tuple[str, str, str]]:
    """Tag, path and value of every attribute and text of elements without children."""
    for child in element:
        inside = f"{path}/{child.tag}" if path else child.tag
        if len(child):
            yield from _xml_leaves(child, inside)
        else:
            yield from ((child.tag, f"{inside}/@{name}", value) for name, value in child.attrib.items())
            yield child.tag, inside, (child.text or "").strip()


def _same(wanted: Any, found: Any) -> bool:
    """Whether values are equal, as numbers (hexadecimal texts included) where both are."""
    first, second = _number(wanted), _number(found)
    if first is not None and second is not None:
        return math.isclose(first, second, rel_tol=_ROUNDING, abs_tol=1e-15)
    return type(wanted) is type(found) and bool(wanted == found)


def _number(value: Any) -> float | None:
    if isinstance(value, bool) or value is None:
        return None
    try:
        if isinstance(value, str) and value.lower().startswith("0x"):
            return float(int(value, 16))
        return float(value)
    except (TypeError, ValueError):
        return None
