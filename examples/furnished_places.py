"""Ten furnished places as a camera and as a radar sees them: view, energy and range.

    python examples/furnished_places.py              all ten, 128 x 128 pixels
    python examples/furnished_places.py --quick      two of them, 48 x 48

Everything comes from --seed. Of a few random stands the one with most kinds of furniture in view is shown.
"""

import argparse
import warnings
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import rfgen_sionna as rfgen
from rfgen_sionna.generative.environment.viewpoints import PlaceRenderer, ViewpointRanges, choose_viewpoint
from rfgen_sionna.scene import MaterialRangeWarning
from rfgen_sionna.scene.furnished import PLACES

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--quick", action="store_true", help="two places, few pixels")
parser.add_argument("--seed", type=int, default=8)
parser.add_argument("--output", type=Path, default=Path("furnished_places.png"), help="picture to draw")
arguments = parser.parse_args()

warnings.simplefilter("ignore", MaterialRangeWarning)  # asphalt is measured up to 40 GHz
places = PLACES[:2] if arguments.quick else PLACES
pixels, stands = (48, 2) if arguments.quick else (128, 24)
ranges = ViewpointRanges(height=(1.2, 1.7), pitch_deg=(3, 12), fov_deg=(70, 78))
radar = rfgen.Radar.load("awr1843")


def photograph(renderer, viewpoint, pixels):
    """(row, column, 3) colours in daylight: what a camera beside the radar would see."""
    directions = viewpoint.view((pixels, pixels)).directions.reshape(-1, 3)
    hits = renderer.rays.first_hit(viewpoint.position, directions)
    hit = hits.object >= 0
    corners = renderer.rays.corners(hits.facet[hit])
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    facing = np.einsum("ri,ri->r", normal, directions[hit])
    normal *= -np.sign(facing)[:, None]
    light = 0.35 + 0.4 * np.clip(normal @ (-0.35, 0.45, 0.82), 0, 1) + 0.3 * np.abs(facing)
    image = np.tile((0.75, 0.85, 0.95), (len(directions), 1))
    image[hit] = renderer.scene.colours[hits.object[hit]] * light[:, None]
    return np.clip(image, 0, 1).reshape(pixels, pixels, 3)


columns = min(5, len(places))
rows = -(-len(places) // columns)
figure, axes = plt.subplots(3 * rows, columns, figsize=(2.6 * columns, 8.2 * rows), squeeze=False, layout="constrained")
for number, place in enumerate(places):
    scene = rfgen.furnished(place, seed=arguments.seed)
    scene.tune(radar.center_frequency)
    renderer, rng = PlaceRenderer(scene, radar), np.random.default_rng(arguments.seed)
    shots = [choose_viewpoint(renderer, rng, ranges) for _ in range(stands)]
    viewpoint = max(shots, key=lambda each: len(renderer.in_view(renderer.first_hits(each, 48, 48)[0], share=0.01)))
    pir = renderer.render(viewpoint, (pixels, pixels), bounces=2)
    energy = 10 * np.log10(np.where(pir.energy > 0, pir.energy, np.nan))
    distance = np.log10(pir.time_of_arrival * 1.5e8)
    top, column = 3 * (number // columns), number % columns
    axes[top][column].set_title(place)
    axes[top][column].imshow(photograph(renderer, viewpoint, 2 * pixels))
    for panel, image, colours in ((1, energy, "magma"), (2, distance, "viridis_r")):
        low, high = np.nanpercentile(image, (1, 99.5))
        axes[top + panel][column].imshow(image, vmin=low, vmax=high, cmap=colours)
        axes[top + panel][column].set_facecolor("black" if panel == 1 else "white")
    kinds = ", ".join(f"{count} {kind}" for kind, count in scene.layout.kinds.items())
    print(f"{place:<12} {kinds}")
for panel, name in enumerate(("view", "energy (dB)", "range (log)")):
    for row in range(rows):
        axes[3 * row + panel][0].set_ylabel(name)
for panel in axes.ravel():
    panel.set_xticks([])
    panel.set_yticks([])
figure.savefig(arguments.output, dpi=70)
print(f"picture      {arguments.output}")
