"""Records that print in a few lines, whatever their size."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

MAX_LINES, MAX_CHARACTERS = 8, 560
"""Bounds of the text of a record."""
_WIDTH, _MAX_VALUE = 110, 60


class ShortRepr:
    """Base of records whose `repr` is a few lines: the class and the facts of :meth:`_facts`, separated by commas.

    A dataclass is to be declared with `repr=False`.
    """

    def _facts(self) -> Iterable[str]:
        """Facts in the order of their importance; by default the fields, arrays as shape and type."""
        return _field_facts(self)

    def __repr__(self) -> str:
        text = f"{type(self).__name__}({', '.join(filter(None, self._facts()))})"
        lines = textwrap.wrap(
            text, _WIDTH, subsequent_indent="    ", max_lines=MAX_LINES, placeholder=" …)", break_on_hyphens=False
        )
        short = "\n".join(lines)
        return short if len(short) <= MAX_CHARACTERS else f"{short[: MAX_CHARACTERS - 3]} …)"


def _field_facts(record: Any) -> Iterator[str]:
    if not is_dataclass(record):
        return
    for item in fields(record):
        value = getattr(record, item.name)
        if item.name.startswith("_") or value is None or callable(value):
            continue
        yield f"{item.name}={short_value(value)}"


def short_value(value: Any) -> str:
    """Value in at most 60 characters; arrays as shape and type, long collections as their length."""
    shape, kind = getattr(value, "shape", None), getattr(value, "dtype", None)
    if shape and kind is not None:
        return f"{' × '.join(map(str, shape))} {kind}"
    if isinstance(value, ShortRepr):
        return f"{type(value).__name__}(…)"
    if isinstance(value, (tuple, list, Mapping, set, frozenset)):
        text = repr(value) if len(value) <= 8 else ""
        return text if 0 < len(text) <= _MAX_VALUE else f"{len(value)} entries"
    text = f"{value:.6g}" if isinstance(value, float) else repr(value)
    return text if len(text) <= _MAX_VALUE else f"{text[: _MAX_VALUE - 1]}…"


def name_list(names: Iterable[str], most: int = 4) -> str:
    """Names separated by commas, at most the first few and the number of the others."""
    known = [name if len(name) <= 30 else f"{name[:29]}…" for name in names]
    rest = f" and {len(known) - most} more" if len(known) > most else ""
    return ", ".join(known[:most]) + rest


def time_span(times: Any) -> str:
    """First and last of ascending times [s]; empty without times."""
    if not len(times):
        return ""
    first, last = float(times[0]), float(times[-1])
    return f"{first:.4g} s" if len(times) == 1 else f"{first:.4g} … {last:.4g} s"


def short_vector(values: Iterable[float]) -> str:
    """Coordinates in parentheses."""
    return f"({', '.join(f'{round(float(value), 9) + 0.0:.4g}' for value in values)})"
