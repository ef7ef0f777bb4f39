"""Progress of a build: recordings that are done, their rate, and the time left."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

BuildProgress = Callable[[int, int], None]
"""Function of the numbers of recordings that are done, failures among them, and of failures."""


@contextmanager
def progress_steps(progress: bool | Callable[[int, int], None] | None, count: int) -> Iterator[BuildProgress]:
    """Context with the function that shows the progress: a bar for True, or a caller's function of the numbers of
    finished recordings and of all."""
    if progress is None or progress is False:
        yield lambda done, failed: None
    elif progress is True:
        with _bar(count) as step:
            yield step
    elif callable(progress):
        yield lambda done, failed: progress(done, count)
    else:
        raise TypeError(f"progress is {progress!r}: True, False or a function of two numbers of recordings is needed")


@contextmanager
def _bar(count: int) -> Iterator[BuildProgress]:
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns: tuple[Any, ...] = (TextColumn("recordings"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    begun: list[float] = []
    with Progress(*columns, TextColumn("{task.fields[rate]}")) as bar:
        task = bar.add_task("", total=count, rate="")

        def step(done: int, failed: int) -> None:
            if not begun:
                begun.extend((time.monotonic(), done))
            text = rate_text(done - int(begun[1]), count - done, time.monotonic() - begun[0])
            bar.update(task, completed=done, rate=text + (f", {failed} not made" if failed else ""))

        yield step


def rate_text(made: int, left: int, seconds: float) -> str:
    """Rate and time left in words; empty before the first recording."""
    if made <= 0 or seconds <= 0.0:
        return ""
    minutes = left * seconds / made / 60.0
    time_left = f"{minutes / 60.0:.1f} h" if minutes >= 90.0 else f"{minutes:.0f} min" if minutes >= 1.5 else "a minute"
    return f"{3600.0 * made / seconds:.0f} an hour" + (f", {time_left} left" if left else "")
