"""What was decided about a person and a scene, and by whom: the prompt, an argument, a default or the seed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

PROMPT = "from the prompt"
NEGATIVE = "from the negative prompt"
DEFAULT = "default"


def drawn(seed: int, options: Iterable[str] = ()) -> str:
    """The origin of what a seed decided, among `options` where words left these open."""
    between = " or ".join(options)
    return f"drawn from {between} (seed {seed})" if between else f"drawn from seed {seed}"


def argument(name: str) -> str:
    """The origin of what an argument of a function (or an option of the command line) said."""
    return f"from the argument {name}"


@dataclass(frozen=True)
class Decision:
    """One thing that had to be decided."""

    name: str
    value: str
    origin: str
    """`PROMPT`, `NEGATIVE`, `DEFAULT`, :func:`drawn` or :func:`argument`, or how it follows from others."""


def tabulate(decisions: Iterable[Decision]) -> list[str]:
    """One line each, in columns."""
    rows = list(decisions)
    first, second = (max((len(getattr(row, field)) for row in rows), default=0) for field in ("name", "value"))
    return [f"  {row.name:<{first}}  {row.value:<{second}}  {row.origin}" for row in rows]
