"""`rfgen dataset`: data sets of many recordings, from a recipe."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from rfgen_sionna.cli.console import err, out, progress, report_written

if TYPE_CHECKING:
    from rfgen_sionna.recipes.building import BuildReport

_RECIPE = """[bold]A recipe[/bold] is a TOML file. The smallest one:

count = 100\n
prompts = ["a person waves", "a person walks to and fro", "a person sits down"]\n
radar = "awr1843"\n
preset = "mmmesh"

Any value may be a list to choose from, {choice = ["a", "b"], weights = [3, 1]}, {range = [2.0, 4.0]} or \
{grid = [1, 2]}, all grids one after the other. Further keys: places, people, distance_m, azimuth_deg, \
orientation_deg, duration_s, receiver, keep, bodies, splits, sources (clips, joints, meshes), radars (several), \
shard_size, seed. `examples/recipes/` has some to start from."""

datasets = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="rich",
    help="Data sets of many labelled recordings: plan, build, resume, verify, repair, show, export.",
    epilog=f"""{_RECIPE}

[bold]From a recipe to a training loop[/bold]

rfgen dataset plan gestures.toml --sheet scenes.png

rfgen dataset build gestures.toml gestures/

rfgen dataset resume gestures/

rfgen dataset verify gestures/

Then, in Python: rfgen_sionna.open_dataset("gestures/")\\[0] is a recording, and \
rfgen_sionna.dataset.torch.RadarDataset loads it for training.""",
)

_PLAN = """[bold]Examples[/bold]

rfgen dataset plan gestures.toml

rfgen dataset plan gestures.toml --probes 0

rfgen dataset plan gestures.toml --sheet scenes.png --workers 8

The recipe is checked whole: unknown keys, prompts that cannot be met, places that are too small. A few are made \
to see how large recordings are, and how long they take on this machine."""

_BUILD = """[bold]Examples[/bold]

rfgen dataset build gestures.toml gestures/

rfgen dataset build gestures.toml gestures/ --workers 4

rfgen dataset build gestures.toml /shared/gestures --engine ray --address auto

rfgen dataset build gestures.toml /shared/gestures --engine ray --address auto --gpus-per-worker 0.25

A recording depends on the recipe and its number alone: order, engine and number of workers never change a bit. \
What cannot be made is listed with its reason and seed; the rest goes on. After ^C, a crash or a full disk, \
`rfgen dataset resume` makes the rest."""

_RESUME = """[bold]Examples[/bold]

rfgen dataset resume gestures/

rfgen dataset resume gestures/ --recipe gestures.toml

What is missing is made, and nothing else; so are recordings whose worker crashed. The folder has the recipe; \
--recipe is needed where that names files by relative paths."""

_VERIFY = """[bold]Examples[/bold]

rfgen dataset verify gestures/

Each file is compared with its checksum in SHA256SUMS (so does `sha256sum -c SHA256SUMS`), and recordings of damaged \
shards with the index. The exit code is 1 where something is damaged."""

_REPAIR = """[bold]Examples[/bold]

rfgen dataset repair gestures/

Damaged recordings are made again, the same bits, and put beside the whole ones; index, card, recipe and checksums are \
written again."""

_SHOW = """[bold]Examples[/bold]

rfgen dataset show gestures/

rfgen dataset show gestures/ --output sheet.pdf --count 40 --seed 1

A row for each recording: mesh or joints, range-Doppler map, micro-Doppler and point cloud."""

_EXPORT = """[bold]Examples[/bold]

rfgen dataset export gestures/ gestures-npy/ --format npy

rfgen dataset export gestures/ gestures-di/ --format di_gesture --split train"""

_AUGMENT = """[bold]Examples[/bold]

rfgen dataset augment gestures/ more/ --variants variants.toml

rfgen dataset augment gestures/ more/ --resume

The set was built with "paths" in keep. The file has a table \\[\\[variants]] for each variant, with any of preset, \
radar, receiver (a table, such as {adc = {bits = 12, full_scale_dbm = -26.0}}) and seed; an empty one is other noise."""

RecipeFile = Annotated[Path, typer.Argument(help="TOML file of the recipe.", dir_okay=False, show_default=False)]
Folder = Annotated[Path, typer.Argument(help="Folder of the data set.", file_okay=False, show_default=False)]
OwnRecipe = Annotated[
    Path | None,
    typer.Option(help="The recipe, where that in the folder names files by relative paths.", dir_okay=False),
]
Workers = Annotated[
    int | None, typer.Option(min=1, help="Processes, each on one core (default: one for each core, as memory allows).")
]
Engine = Annotated[str, typer.Option(help='"processes" of this machine, or "ray", a cluster.')]
Address = Annotated[str | None, typer.Option(help='Cluster of Ray: "auto", its address, or "local" (default).')]
Gpus = Annotated[float, typer.Option(min=0.0, help="GPUs of each worker, such as 0.25; 0 computes on the CPU.")]
TimeLimit = Annotated[
    float | None, typer.Option(help="Longest time of one recording in seconds, with processes; then it fails.")
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace an existing file.")]


@datasets.command(epilog=_PLAN)
def plan(
    recipe: RecipeFile,
    sheet: Annotated[Path | None, typer.Option(help="Picture of sample scenes to write.", dir_okay=False)] = None,
    probes: Annotated[int, typer.Option(min=0, help="Recordings that are made to measure; 0 only checks.")] = 8,
    workers: Workers = None,
    overwrite: Overwrite = False,
) -> None:
    """Check a recipe; say what it makes, how large it is and how long it takes."""
    from rfgen_sionna.recipes import Recipe
    from rfgen_sionna.recipes.planning import plan_dataset

    read = Recipe.load(recipe)
    with progress("probes") as step:
        found = plan_dataset(read, probes=probes, workers=workers, sheet=sheet, overwrite=overwrite, progress=step)
    out.print(escape(str(found)), soft_wrap=True, highlight=False)


@datasets.command(epilog=_BUILD)
def build(
    recipe: RecipeFile,
    output: Annotated[Path, typer.Argument(help="Folder of the data set, new or empty.", show_default=False)],
    workers: Workers = None,
    engine: Engine = "processes",
    address: Address = None,
    gpus_per_worker: Gpus = 0.0,
    time_limit: TimeLimit = None,
    order: Annotated[str, typer.Option(help='"forward" or "reversed"; the set is the same.')] = "forward",
) -> None:
    """Make the recordings of a recipe."""
    from rfgen_sionna.recipes.building import build_dataset

    options: dict[str, Any] = {"engine": engine, "address": address, "gpus_per_worker": gpus_per_worker, "order": order}
    with _continued_later(output):
        report = build_dataset(recipe, output, workers=workers, time_limit=time_limit, progress=True, **options)
    _report(report)


def _of_a_set(make: Callable[..., BuildReport | None]) -> Callable[..., None]:
    """Command that makes recordings of a set that is there, with the options of a build."""

    def command(
        folder: Folder,
        recipe: OwnRecipe = None,
        workers: Workers = None,
        engine: Engine = "processes",
        address: Address = None,
        gpus_per_worker: Gpus = 0.0,
        time_limit: TimeLimit = None,
    ) -> None:
        options: dict[str, Any] = {"engine": engine, "address": address, "gpus_per_worker": gpus_per_worker}
        report = make(folder, recipe, workers=workers, time_limit=time_limit, progress=True, **options)
        if report is None:
            out.print(f"[green]whole:[/green] nothing in {escape(str(folder))} is damaged", soft_wrap=True)
        else:
            _report(report)

    command.__doc__ = make.__doc__
    return command


@datasets.command("resume", epilog=_RESUME)
@_of_a_set
def resume(folder: Path, recipe: Path | None, **options: Any) -> BuildReport:
    """Make what an interrupted build lacks."""
    from rfgen_sionna.recipes.building import build_dataset
    from rfgen_sionna.recipes.set_facts import recipe_of_set

    with _continued_later(folder):
        return build_dataset(recipe_of_set(folder, recipe), folder, resume=True, **options)


@datasets.command(epilog=_VERIFY)
def verify(folder: Folder) -> None:
    """Find every damaged byte of a data set."""
    from rfgen_sionna.recipes.repairing import verify_dataset

    with out.status("reading"):
        found = verify_dataset(folder)
    for each in found:
        which = f" (recordings {', '.join(map(str, each.recordings))})" if each.recordings else ""
        err.print(f"[red]damaged:[/red] {escape(f'{each.file}: {each.reason}{which}')}", soft_wrap=True)
    if found:
        err.print(f"rfgen dataset repair {escape(str(folder))} makes it again", soft_wrap=True)
        raise typer.Exit(1)
    out.print(f"[green]whole:[/green] all files of {escape(str(folder))} are as they were written", soft_wrap=True)


@datasets.command("repair", epilog=_REPAIR)
@_of_a_set
def repair(folder: Path, recipe: Path | None, **options: Any) -> BuildReport | None:
    """Give damaged files their old bytes back."""
    from rfgen_sionna.recipes.repairing import repair_dataset

    return repair_dataset(folder, recipe, **options)


@datasets.command(epilog=_AUGMENT)
def augment(
    folder: Folder,
    output: Annotated[Path, typer.Argument(help="Folder of the new set, new or empty.", show_default=False)],
    variants: Annotated[Path | None, typer.Option(help="TOML file of the variants.", dir_okay=False)] = None,
    keep: Annotated[list[str] | None, typer.Option(help="What is stored, each (default: as in the set).")] = None,
    workers: Workers = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the set in OUTPUT and its variants.")] = False,
) -> None:
    """Make recordings of other noise, receivers or presets from stored paths, without a trace."""
    from rfgen_sionna.recipes.augmentation import augment_dataset, read_variants, variants_of

    if (variants is None) != resume:
        raise ValueError("--variants FILE begins a set, --resume goes on with one: give one of them")
    chosen = variants_of(output) if variants is None else read_variants(variants)
    made = augment_dataset(folder, output, chosen, keep=keep, workers=workers, resume=resume, progress=True)
    out.print(escape(str(made)), soft_wrap=True, highlight=False)
    report_written(output)


@datasets.command(epilog=_SHOW)
def show(
    folder: Folder,
    output: Annotated[Path | None, typer.Option(help="Picture to write (default: FOLDER.png).", dir_okay=False)] = None,
    count: Annotated[int, typer.Option(min=1, help="Recordings on the sheet.")] = 24,
    seed: Annotated[int, typer.Option(min=0, help="Seed of their choice.")] = 0,
    overwrite: Overwrite = False,
) -> None:
    """Draw a contact sheet of a data set."""
    from rfgen_sionna.dataset import open_dataset
    from rfgen_sionna.show.contact_sheet import draw_dataset_sheet

    out.print(escape(str(open_dataset(folder))), soft_wrap=True, highlight=False)
    target = folder.absolute().with_suffix(".png") if output is None else output
    with progress("recordings") as step:
        written = draw_dataset_sheet(folder, target, count=count, seed=seed, overwrite=overwrite, progress=step)
    report_written(written)


@datasets.command(epilog=_EXPORT)
def export(
    folder: Folder,
    output: Annotated[Path, typer.Argument(help="Folder to write.", show_default=False)],
    format: Annotated[str, typer.Option(help="webdataset, npy, radhar, mmmesh or di_gesture.")],
    split: Annotated[str | None, typer.Option(help="Split to export (default: all).")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Write a data set in the layout of a published pipeline."""
    from rfgen_sionna.dataset.exports import export_dataset

    with progress("recordings") as step:
        written = export_dataset(folder, output, format, split=split, overwrite=overwrite, progress=step)
    report_written(written)


@contextmanager
def _continued_later(folder: Path) -> Iterator[None]:
    """Context of a build that says at ^C how it goes on."""
    try:
        yield
    except KeyboardInterrupt:
        err.print(f"stopped; rfgen dataset resume {escape(str(folder))} makes the rest", soft_wrap=True)
        raise


def _report(report: BuildReport) -> None:
    """Print what was made, and each failure; exit with 1 if a later call may make more, or nothing was made."""
    from rfgen_sionna.recipes.outcome import FINAL

    for failure in report.failures:
        what = f"recording {failure.number} (seed {failure.seed}): {failure.reason}"
        err.print(f"[red]not made:[/red] {escape(what)}", soft_wrap=True)
    for text, count in report.warnings.items():
        err.print(f"[yellow]warning[/yellow] of {count} recordings: {escape(text)}", soft_wrap=True)
    made = f"{report.count} recordings, {report.made} of them made now"
    out.print(f"{made}{f', {len(report.failures)} not made' if report.failures else ''}", soft_wrap=True)
    report_written(report.folder)
    if not report.count or any(failure.kind not in FINAL for failure in report.failures):
        raise typer.Exit(1)
