"""Pictures of the benchmark."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

STYLES = {
    "tracer": ("o-", "#d1495b", "this package, facets"),
    "beams": ("D-", "#edae49", "this package, beams"),
    "rays, adaptive": ("v-", "#8e4585", "this package, rays, adaptive"),
    "rays, uniform": ("v:", "#b784b0", "this package, rays, uniform"),
    "one sample per pixel": ("s--", "#30638e", "one sample per pixel"),
    "one sample per pixel, jittered": ("^:", "#5d8fb8", "one sample per pixel, fresh jitter"),
    "Sionna, specular": ("X", "#2e933c", "Sionna's PathSolver, specular"),
    "Sionna, diffuse": ("P-.", "#77a861", "Sionna's PathSolver, diffuse"),
}
LEAST = 1e-7
"""Errors below it are drawn there."""


def _axes(columns: int = 1, width: float = 6.4, height: float = 5.0) -> tuple[Any, Any, Any]:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, columns, figsize=(width * columns, height), constrained_layout=True)
    return plt, figure, axes


def pareto(result: dict[str, Any], path: Path) -> None:
    """Time of an instant on x, relative error on y, one curve per method through its best settings: those to which no
    other is both faster and more accurate. The thin lines are views that are no wider than the subject."""
    plt, figure, axes = _axes()
    for name, (style, color, label) in STYLES.items():
        rows = [row for row in result["rows"] if row["method"] == name]
        views = sorted({row.get("view_deg", 0.0) for row in rows}, reverse=True)
        for view in views:
            some = _front([row for row in rows if row.get("view_deg", 0.0) == view])
            wide = view in (0.0, 60.0)
            axes.loglog(
                [1e3 * row["seconds"] for row in some], [max(row["relative"], LEAST) for row in some], style,
                color=color, label=label + (f", {view:g}° view" if view else ""), alpha=1.0 if wide else 0.45,
                linewidth=1.6 if wide else 0.9, markersize=6 if wide else 4,
            )  # fmt: skip
    if own := result.get("truth_own_error"):
        axes.axhline(own, color="k", linewidth=0.7, linestyle=":")
        axes.annotate("what the truth is known to", (0.99, own), xycoords=("axes fraction", "data"), fontsize=7,
                      ha="right", va="bottom")  # fmt: skip
    axes.set(xlabel="time of an instant [ms]", ylabel="relative error of the return")
    axes.set_title(f"{result['title']}, {result['band_ghz']} GHz\ntruth: {result['truth']}", fontsize=9)
    axes.grid(True, which="major", alpha=0.3)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False, fontsize=7)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _front(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows that no other one beats in both time and error, the fastest first."""
    kept: list[dict[str, Any]] = []
    for row in sorted(rows, key=lambda row: row["seconds"]):
        if not kept or row["relative"] < kept[-1]["relative"]:
            kept.append(row)
    return kept


def scaling(result: dict[str, Any], path: Path) -> None:
    plt, figure, axes = _axes(1, 7.0, 4.6)
    for name, curve in result.items():
        sizes, seconds = np.array(curve["sizes"], float), np.array(curve["seconds"])
        axes.loglog(sizes, seconds, "o-", markersize=4, label=f"{name}: ∝ n^{curve['exponent']:.2f}")
    axes.set(xlabel="n", ylabel="time [s]")
    axes.grid(True, which="major", alpha=0.3)
    axes.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def synthesisers(result: dict[str, Any], path: Path) -> None:
    plt, figure, axes = _axes()
    ours = [row for row in result["rows"] if row["method"] == "ours"]
    axes.loglog(
        [row["seconds"] for row in ours], [row["relative"] for row in ours], "o-", color="#d1495b", label="ours"
    )
    for row, color in zip((r for r in result["rows"] if r["method"] != "ours"), ("#30638e", "#2e933c"), strict=False):
        axes.loglog(row["seconds"], max(row["relative"], 1e-13), "s", color=color, label=row["method"])
    axes.set(xlabel="time of a frame [s]", ylabel="relative error of the samples")
    axes.set_title(f"synthesis of {result['paths']:,} paths, frame {result['frame']}", fontsize=9)
    axes.grid(True, which="major", alpha=0.3)
    axes.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=110)
    plt.close(figure)
