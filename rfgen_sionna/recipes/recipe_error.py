"""The error of a recipe."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class RecipeError(ValueError):
    """A recipe that cannot be made: the message names the key, its value and what is allowed."""


@contextmanager
def faults_of(key: str) -> Iterator[None]:
    """Errors of the value of a key as a :class:`RecipeError` that names it.

    Raises:
        RecipeError: a value, type, file or package in it is at fault.
    """
    try:
        yield
    except RecipeError as error:
        raise RecipeError(f"{key}: {error}") from None
    except (ValueError, TypeError, OSError, ImportError, ArithmeticError, LookupError, RecursionError) as error:
        raise RecipeError(f"{key}: {error}") from error
