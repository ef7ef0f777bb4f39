"""Render a PIR data set of furnished places: `python -m training.environment.render --out FOLDER`.

What it writes: :mod:`training.environment.pir_data`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, cast

import h5py
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from rfgen_sionna.generative.environment.viewpoints import ViewpointRanges
from rfgen_sionna.pir.projection import PROJECTIONS, check_projection
from training.environment.pir_data import PLACES, DataError
from training.environment.shards import Kind, Settings, check_folder, shard_file, write_shard

PRESETS = {"paper": 800, "ours": 10_000}
"""Views of the two settings."""


def render(folder: Path, settings: Settings, count: int, workers: int = 1, progress: Progress | None = None) -> int:
    """Render `count` views into a folder; whole shards that are there are kept. How many were rendered.

    Raises
    ------
    DataError
        The folder holds a data set of other settings.
    """
    if count < 1:
        raise DataError(f"count is {count}: at least 1 is needed")
    folder.mkdir(parents=True, exist_ok=True)
    check_folder(folder, settings)
    jobs = [
        (number, min(settings.per_shard, count - number * settings.per_shard))
        for number in range(-(-count // settings.per_shard))
    ]
    missing = [(number, views) for number, views in jobs if _views_in(shard_file(folder, number)) < views]
    bar = None
    if progress is not None:
        done = count - sum(views for _, views in missing)
        bar = progress.add_task(settings.kind, total=count, completed=done)
    for views in _done(folder, settings, missing, workers):
        if progress is not None and bar is not None:
            progress.advance(bar, views)
    return sum(views for _, views in missing)


def _views_in(file: Path) -> int:
    if not file.is_file():
        return 0
    with h5py.File(file) as shard:
        return len(shard["energy"])


def _done(folder: Path, settings: Settings, jobs: list[tuple[int, int]], workers: int) -> Iterator[int]:
    """Views of each shard as it is finished."""
    if workers == 1:
        for number, views in jobs:
            yield write_shard(folder, settings, number, views)
        return
    # Mitsuba does not survive a fork.
    with _pool(workers) as pool:
        running: set[Future[int]] = {pool.submit(write_shard, folder, settings, *job) for job in jobs}
        while running:
            finished, running = wait(running, return_when=FIRST_COMPLETED)
            for each in finished:
                yield each.result()


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"))
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown()


def main(
    out: Annotated[Path, typer.Option(help="Folder for the shards. What is there is kept: the same command goes on.")],
    count: Annotated[int | None, typer.Option(help="Number of views; overrides --preset.", min=1)] = None,
    preset: Annotated[str, typer.Option(help="'paper': 800 views. 'ours': 10,000.")] = "ours",
    kind: Annotated[
        str,
        typer.Option(
            help="'environment': places as they are, for text to image. 'pairs': each view twice, complete (all "
            "furniture, its own materials, reflections) and incomplete (first order, default materials, things "
            "missing), for path diffusion."
        ),
    ] = "environment",
    seed: Annotated[
        int, typer.Option(help="Everything is drawn from it. Data sets of two seeds share no layout.", min=0)
    ] = 0,
    places: Annotated[str, typer.Option(help=f"Comma-separated; all are {', '.join(PLACES)}.")] = ",".join(PLACES),
    views: Annotated[int, typer.Option(help="Views of each layout; they share the work of building it.", min=1)] = 4,
    resolution: Annotated[int, typer.Option(help="Rows and columns of an image.", min=4, max=1024)] = 64,
    people: Annotated[
        float | None, typer.Option(help="Share of the views with somebody in them; 0, or 0.5 for pairs.", min=0, max=1)
    ] = None,
    height: Annotated[tuple[float, float], typer.Option(help="Of the radar, lowest and highest [m].")] = (0.5, 2.0),
    pitch: Annotated[tuple[float, float], typer.Option(help="Tilt, least and greatest [deg]; positive looks down.")] = (
        -8.0,
        25.0,
    ),
    fov: Annotated[tuple[float, float], typer.Option(help="Horizontal field of view, least and greatest [deg].")] = (
        40.0,
        100.0,
    ),
    roll: Annotated[tuple[float, float], typer.Option(help="About the line of sight, least and greatest [deg].")] = (
        0.0,
        0.0,
    ),
    projections: Annotated[
        str, typer.Option(help=f"Comma-separated, as often each; there are {', '.join(PROJECTIONS)}.")
    ] = PROJECTIONS[0],
    radar: Annotated[str, typer.Option(help="Radar whose band counts: a name or a TOML file.")] = "awr1843",
    workers: Annotated[int, typer.Option(help="Processes; 0 is one for each core.", min=0)] = 0,
) -> None:
    """Render images of what a radar receives from furnished places (PIRs), with captions, into HDF5 shards.

    Every view is drawn from the seed: a layout, a free spot for the radar, its height, tilt, direction and field of
    view, and roll and projection where several are allowed. Layouts fall into train, validation and test by their
    seed. Stop it whenever you like: shards that are done stay, the same command goes on where it was, and a larger
    --count adds to what is there.

    [bold]The paper's setting:[/bold] --preset paper. [bold]Ours:[/bold] --preset ours, then --kind pairs in a folder of
    its own.
    """
    console = Console()
    if preset not in PRESETS:
        raise typer.BadParameter(f"preset is {preset!r}: allowed are {', '.join(PRESETS)}")
    try:
        settings = Settings(
            kind=cast(Kind, kind),
            seed=seed,
            places=_names(places),
            views=views,
            resolution=(resolution, resolution),
            people=(0.5 if kind == "pairs" else 0.0) if people is None else people,
            ranges=ViewpointRanges(
                height, pitch, fov, roll, tuple(check_projection(name) for name in _names(projections))
            ),
            radar=radar,
        )
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        with Progress(*columns, TimeRemainingColumn(), console=console) as bar:
            made = render(out, settings, count or PRESETS[preset], workers or os.cpu_count() or 1, bar)
    except ValueError as error:
        console.print(f"[red]{error}[/red]", highlight=False)
        raise typer.Exit(2) from error
    console.print(f"{made} views rendered, {count or PRESETS[preset]} in {out}")


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(",") if name.strip())


app = typer.Typer(add_completion=False, rich_markup_mode="rich")
app.command()(main)

if __name__ == "__main__":
    app()
