"""Decisions about a person and a scene with their origins: the prompt, an argument, a default or the seed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

PROMPT = "from the prompt"
NEGATIVE = "from the negative prompt"
DEFAULT = "default"


def drawn(seed: int, options: Iterable[str] = ()) -> str:
    """Origin of a draw by a seed, among `options` if words leave these open."""
    between = " or ".join(options)
    return f"drawn from {between} (seed {seed})" if between else f"drawn from seed {seed}"


def argument(name: str) -> str:
    """Origin of a value from an argument of a function (or an option of the command line)."""
    return f"from the argument {name}"


@dataclass(frozen=True)
class Decision:
    """Value of one property of a run, and its origin."""

    name: str
    value: str
    origin: str
    """`PROMPT`, `NEGATIVE`, `DEFAULT`, :func:`drawn`, :func:`argument`, or a derivation from others."""


def tabulate(decisions: Iterable[Decision]) -> list[str]:
    """One line a decision, in columns."""
    rows = list(decisions)
    first, second = (max((len(getattr(row, field)) for row in rows), default=0) for field in ("name", "value"))
    return [f"  {row.name:<{first}}  {row.value:<{second}}  {row.origin}" for row in rows]
