"""`rfgen things`: animals and things that prompts and `Actor.thing` know."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from rfgen_sionna.cli.console import out as _out
from rfgen_sionna.cli.console import report_written

EPILOG = """[bold]Examples[/bold]

rfgen things

rfgen things drone

rfgen things --draw things.png --seed 3"""


def things(
    name: Annotated[str, typer.Argument(help="Name of a kind; none lists all.")] = "",
    draw: Annotated[Path | None, typer.Option(help="Picture to write.", show_default=False)] = None,
    action: Annotated[str | None, typer.Option(help="Action of the picture.", show_default="the first")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of sizes and details in the picture.")] = 0,
    time: Annotated[float, typer.Option(help="Time of the picture [s].")] = 1.0,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing picture.")] = False,
) -> None:
    """List animals and things with their actions, sizes and parameters, and draw them."""
    from rfgen_sionna.generative.things.thing_catalogue import THINGS, thing_action, thing_kind

    kinds = {kind.name: kind for kind in ([thing_kind(name)] if name else THINGS.values())}
    if action is not None:
        if not name:
            raise ValueError(f"--action is {action!r}, of which kind? Name one, such as: rfgen things dog --action run")
        thing_action(kinds[next(iter(kinds))], action)
    if draw is not None and draw.exists() and not overwrite:
        raise FileExistsError(f"'{draw}' exists: name another file, or add --overwrite")
    if name:
        kind = kinds[next(iter(kinds))]
        _out.print(f"[bold]{kind.name}[/bold]: {kind.description}")
        _out.print(f"size: {kind.size}")
        _out.print("actions:")
        for key, does in kind.actions.items():
            speed = f", {does.speed:.2g} m/s, at most {does.fastest:.2g} m/s" if does.speed else ""
            _out.print(f"  {key}: {does.description}{speed}")
        _out.print("parameters:" if kind.parameters else "no parameters")
        for key, parameter in kind.parameters.items():
            usual, allowed = (f"{low:g} … {high:g}" for low, high in (parameter.usual, parameter.allowed))
            _out.print(f"  {key}: {escape(parameter.meaning)}, usually {usual}, allowed {allowed}")
    else:
        table = Table(box=None, padding=(0, 2, 0, 0))
        for heading in ("name", "thing", "actions", "parameters"):
            table.add_column(heading, overflow="fold")
        for kind in kinds.values():
            table.add_row(kind.name, kind.description, ", ".join(kind.actions), ", ".join(kind.parameters))
        _out.print(table)
    if draw is not None:
        from rfgen_sionna.generative.actor import Actor
        from rfgen_sionna.show.mesh_sheet import draw_mesh_sheet

        draw_mesh_sheet({key: Actor.thing(key, action=action, seed=seed) for key in kinds}, draw, time=time)
        report_written(draw)
