"""Recipes whose recordings take a part of a second: a ball before a tiny radar."""

from __future__ import annotations

from pathlib import Path

import trimesh

from tests.unit.tiny_radar import tiny_radar_text


def write_small_recipe(folder: Path, count: int = 6, more: str = "", shard_size: str = "1 MB") -> Path:
    """Recipe of a rolling and a resting metal ball, with its radar and mesh beside it; `more` are further keys."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "tiny.toml").write_text(tiny_radar_text(), encoding="utf-8")
    trimesh.creation.icosphere(subdivisions=1, radius=0.2).export(folder / "ball.stl")
    recipe = folder / "balls.toml"
    recipe.write_text(
        f"""title = "balls"
count = {count}
seed = 5
attempts = 2
duration_s = 0.1
radar = "tiny.toml"
distance_m = {{range = [2.0, 4.0]}}
azimuth_deg = {{range = [-20.0, 20.0]}}
receiver = {{adc = {{bits = 16, full_scale_dbm = -26.0}}}}
rtol = 0.05
shard_size = "{shard_size}"
keep = ["adc", "labels"]
{more}

[splits]
shares = {{train = 0.5, test = 0.5}}
by = ["seed"]

[[sources]]
mesh = "ball.stl"
material = "metal"
velocity_m_s = [0.5, 0.0, 0.0]

[[sources]]
mesh = "ball.stl"
material = "metal"
""",
        encoding="utf-8",
    )
    return recipe
