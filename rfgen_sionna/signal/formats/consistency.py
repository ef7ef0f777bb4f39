"""Whether a tool's own configuration says the same of a capture as the sidecar that lies beside it."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from rfgen_sionna.signal.formats.capture import CaptureFormatError
from rfgen_sionna.signal.formats.files import read_json, warn_or_raise

_ROUNDING = 1e-9


def check_json(path: Path, wanted: dict[str, Any], fields: Collection[str], sidecar: Path, partial: bool) -> None:
    """Compare `fields` wherever they stand in a JSON file with those in `wanted`, what the sidecar makes of it.

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
    _tell(path, next(_differences(wanted, found, fields, ""), None), sidecar, partial)


def check_xml(path: Path, wanted: bytes, ignored: Collection[str], sidecar: Path, partial: bool) -> None:
    """The same for an XML file, all elements and attributes of `wanted` that are not `ignored`."""
    if not path.is_file():
        return
    try:
        found = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, LookupError, ValueError) as error:  # the last two: encodings that are none
        warn_or_raise(f"'{path}' is not XML: {error}", partial)
        return
    _tell(path, next(_elements(ElementTree.fromstring(wanted), found, ignored), None), sidecar, partial)


def _tell(path: Path, difference: tuple[str, Any, Any] | None, sidecar: Path, partial: bool) -> None:
    if difference is None:
        return
    field, found, wanted = difference
    said = "is missing" if found is None else f"is {found!r}"
    warn_or_raise(f"'{path}': {field} {said}; {wanted!r} by '{sidecar.name}' beside it", partial)


def _differences(wanted: Any, found: Any, fields: Collection[str], where: str) -> Iterator[tuple[str, Any, Any]]:
    if isinstance(wanted, dict):
        if not isinstance(found, dict):
            yield where, found, wanted
            return
        for key, value in wanted.items():
            inside = f"{where}.{key}" if where else key
            if isinstance(value, (dict, list)):
                if _has(value, fields):
                    yield from _differences(value, found.get(key), fields, inside)
            elif key in fields and not _same(value, found.get(key)):
                yield inside, found.get(key), value
    elif not isinstance(found, list):
        yield where, found, wanted
    else:
        for index, value in enumerate(wanted):
            other = found[index] if index < len(found) else None
            if isinstance(value, (dict, list)):
                yield from _differences(value, other, fields, f"{where}[{index}]")
            elif not _same(value, other):
                yield f"{where}[{index}]", other, value
        if len(found) > len(wanted):
            yield f"the number of {where}", len(found), len(wanted)


def _has(value: Any, fields: Collection[str]) -> bool:
    """Whether one of the fields stands anywhere inside; a list without any entry is one by its length."""
    if isinstance(value, dict):
        return any(key in fields or _has(inner, fields) for key, inner in value.items())
    return isinstance(value, list) and (not value or any(_has(inner, fields) for inner in value))


def _same(wanted: Any, found: Any) -> bool:
    """Equal as numbers, hexadecimal texts among them, or as they are."""
    numbers = [_number(value) for value in (wanted, found)]
    if None not in numbers:
        return math.isclose(*numbers, rel_tol=_ROUNDING, abs_tol=1e-15)  # type: ignore[arg-type]
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


def _elements(wanted: Any, found: Any, ignored: Collection[str]) -> Iterator[tuple[str, Any, Any]]:
    for element, path in _leaves(wanted, ""):
        if element.tag in ignored:
            continue
        other = found.find(path)
        for name, value in element.attrib.items():
            held = None if other is None else other.get(name)
            if not _same(value, held):
                yield f"{path}/@{name}", held, value
        text, held = (element.text or "").strip(), None if other is None else (other.text or "").strip()
        if not element.attrib and not _same(text, held):
            yield path, held, text


def _leaves(element: Any, path: str) -> Iterator[tuple[Any, str]]:
    for child in element:
        inside = f"{path}/{child.tag}" if path else child.tag
        if len(child):
            yield from _leaves(child, inside)
        else:
            yield child, inside
