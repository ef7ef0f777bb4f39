"""Three-dimensional plot of a frame: shaded meshes, point cloud, radar."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.axes3d import Axes3D  # type: ignore[import-untyped]

from rfgen_sionna._types import FloatArray
from rfgen_sionna.processing.pointcloud import PointCloud
from rfgen_sionna.show.actor_shapes import ActorShape
from rfgen_sionna.show.displayable import Displayable
from rfgen_sionna.show.panels import ACCENT
from rfgen_sionna.show.style import INK, MUTED, VELOCITY_MAP, titled

BODY_COLOUR = np.array([0.72, 0.76, 0.81])


@dataclass(frozen=True)
class PlotLimits:
    """Limits of the axes [m], the same for all frames of a run."""

    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, run: Displayable, shapes: Sequence[ActorShape]) -> PlotLimits:
        """Limits around the radar and the actors' shapes in all frames."""
        places: list[FloatArray] = [np.asarray(run.radar.position, np.float64)[None]]
        for shape in shapes:
            places += [shape.points(frame).astype(np.float64) for frame in range(len(run))]
        places = [each for each in places if len(each)]
        if len(places) == 1:
            reach = run.radar.max_range / 2
            corners = reach * np.array([[1, y, z] for y in (-0.5, 0.5) for z in (-0.25, 0.25)])
            places.append(places[0] + corners @ run.radar.rotation.T)
        low = np.min([place.min(axis=0) for place in places], axis=0)
        high = np.max([place.max(axis=0) for place in places], axis=0)
        margin = np.maximum(0.25, (1.2 - (high - low)) / 2)
        floor = min(low[2], 0.0)
        low, high = low - margin, high + margin
        if run.actors or run.radar.position[2] > 0:  # else the radar has no place in a room
            low[2] = floor
        return cls(low, high)


def draw_scene(
    figure: Figure,
    axes: Axes3D,
    run: Displayable,
    frame: int,
    cloud: PointCloud,
    *,
    limits: PlotLimits,
    shapes: Sequence[ActorShape],
    speed: float,
    zoom: float = 1.15,
) -> None:
    """Meshes or joints, radar and point cloud of one frame; colours are radial velocities up to ±`speed` [m/s].

    Parameters
    ----------
    figure, axes
        Figure and three-dimensional axes.
    run, frame
        The run and the number of the frame.
    cloud
        Detections.
    limits
        Limits of the axes.
    shapes
        Shapes of the actors.
    speed
        Limit of the velocity colours [m/s].
    zoom
        Size of the plot in its axes.
    """
    radar = run.radar
    yaw = np.degrees(radar.orientation[0])
    # From behind and above, a little to the right of the radar: its left is left in the picture.
    axes.view_init(elev=20, azim=float(yaw + 180 + 35))
    for shape in shapes:
        if len(shape.faces):
            _mesh(axes, shape.mesh(frame)[shape.faces].astype(np.float64))
        else:
            joints = shape.joints(frame)
            axes.add_collection3d(Line3DCollection(joints[shape.bones], colors=INK, linewidths=1.0, zorder=3))
    here = np.asarray(radar.position)
    ahead = here + 0.35 * radar.rotation[:, 0]
    axes.plot(*np.stack([here, ahead], axis=1), color=ACCENT, linewidth=1.6, zorder=4)
    axes.scatter(*here[:, None], s=34, marker="s", color=INK, zorder=5, depthshade=False)
    axes.text(here[0], here[1], here[2] + 0.12, radar.name, fontsize=7.5, color=INK, ha="center", zorder=6)
    inside = np.all((cloud.position >= limits.low) & (cloud.position <= limits.high), axis=1)
    size = 7 + 1.1 * np.clip(cloud.snr_db[inside] - 10, 0, 30)
    drawn = axes.scatter(
        *cloud.position[inside].T, s=size, c=cloud.velocity[inside], cmap=VELOCITY_MAP,
        norm=Normalize(-speed, speed), edgecolors=INK, linewidths=0.35, depthshade=False, zorder=7,
    )  # fmt: skip
    below = figure.colorbar(drawn, ax=axes, location="bottom", shrink=0.45, aspect=30, pad=0.02)
    below.set_label("radial velocity [m/s]", fontsize=8, color=INK)
    below.ax.tick_params(labelsize=7.5, colors=INK, width=0.5, length=2.5)
    below.outline.set_linewidth(0.5)
    _frame_axes(axes, limits, zoom)
    titled(axes, "Point cloud and mesh", f"{int(inside.sum())} moving points, size: SNR")


def _mesh(axes: Axes3D, corners: FloatArray) -> None:
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    normal /= np.maximum(length, 1e-12)[:, None]
    azimuth, elevation = np.radians([axes.azim, axes.elev])
    camera = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    front = normal @ camera > -0.1
    light = camera + np.array([0.0, 0.0, 0.9]) + 0.6 * np.cross(camera, [0.0, 0.0, 1.0])
    shade = 0.42 + 0.58 * np.clip(normal[front] @ (light / np.linalg.norm(light)), 0, 1)
    colours = np.clip(shade[:, None] * BODY_COLOUR, 0, 1)
    axes.add_collection3d(
        Poly3DCollection(corners[front], facecolors=colours, edgecolors=colours, linewidths=0.15, zorder=3)
    )


def _frame_axes(axes: Axes3D, limits: PlotLimits, zoom: float) -> None:
    axes.computed_zorder = False
    axes.set_xlim(limits.low[0], limits.high[0])
    axes.set_ylim(limits.low[1], limits.high[1])
    axes.set_zlim(limits.low[2], limits.high[2])
    axes.set_box_aspect(tuple(limits.high - limits.low), zoom=zoom)
    for index, (name, axis) in enumerate((("x", axes.xaxis), ("y", axes.yaxis), ("z", axes.zaxis))):
        axis.set_pane_color((0.955, 0.962, 0.97, 1.0))
        axis.set_label_text(f"{name} [m]", fontsize=8, color=INK)
        axis.set_tick_params(labelsize=7, colors=MUTED, pad=-2)
        axis.labelpad = -4
        axis.set_major_locator(MultipleLocator(0.5 if limits.high[index] - limits.low[index] < 2.5 else 1.0))
        axis.line.set_color(MUTED)
        axis._axinfo["grid"].update(color="#d4dae0", linewidth=0.5)  # mplot3d has no public setter
