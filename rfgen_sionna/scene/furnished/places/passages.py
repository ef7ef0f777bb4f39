"""Corridors and garages."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.scene.furnished.layout import Plan, Wall, person_space
from rfgen_sionna.scene.furnished.piece import pick
from rfgen_sionna.scene.furnished.pieces import (
    buildings,
    decor,
    laboratory,
    outdoors,
    seating,
    shelves,
    storage,
    vehicles,
)
from rfgen_sionna.scene.furnished.places.homes import add_radiators
from rfgen_sionna.scene.furnished.shell import Opening, add_windows, enclose


def corridor(rng: np.random.Generator) -> Plan:
    width, x0 = float(rng.uniform(2.4, 3.4)), -float(rng.uniform(0.6, 3.0))
    shift = float(rng.uniform(-0.15, 0.15))
    y = (shift - width / 2, shift + width / 2)
    half = min(1.2, min(-y[0], y[1]) - 0.05)
    x = (x0, x0 + float(rng.uniform(11, 24)))
    plan = Plan(rng, x, y, float(rng.uniform(2.4, 3.0)), person_space(half))
    openings: list[Opening] = []
    for wall in ("left", "right"):
        u = x0 + rng.uniform(0.7, 2.0)
        while u < x[1] - 0.8:
            if rng.random() < 0.8:
                openings.append(Opening("door", wall, float(u), 0.92, 0.0, 2.03))
            u += rng.uniform(1.8, 4.2)
    if rng.random() < 0.7:
        middle = 0.5 * sum(y)
        found = Opening("door", "far", middle, 0.95, 0.0, 2.03) if rng.random() < 0.5 else None
        openings += [found] if found is not None else add_windows(plan, "far", 1)
    if rng.random() < 0.35:
        openings += add_windows(plan, pick(rng, "left", "right"), int(rng.integers(2, 5)), openings)
    enclose(plan, openings, walls=pick(rng, "plaster", "masonry", "plaster"),
        floor=pick(rng, "linoleum", "tiles", "carpet"), ceiling="ceiling", skirting="plastic")  # fmt: skip
    sides: tuple[Wall, ...] = ("left", "right")
    for _ in range(int(rng.integers(2, 6))):
        kind = int(rng.integers(6))
        if kind == 0:
            plan.at_wall(buildings.lockers(rng), sides)
        elif kind == 1:
            plan.at_wall(buildings.wall_bench(rng), sides)
        elif kind == 2:
            plan.at_wall(decor.plant(rng), sides)
        elif kind == 3:
            plan.at_wall(decor.waste_bin(rng), sides)
        elif kind == 4:
            plan.at_wall(storage.filing_cabinet(rng), sides)
        else:
            plan.at_wall(seating.chair(rng), sides)
    plan.some(0.8, lambda: buildings.extinguisher(rng), lambda thing: plan.on_wall(thing, sides[int(rng.integers(2))]))
    for _ in range(int(rng.integers(1, 4))):
        plan.some(
            0.7, lambda: buildings.notice_board(rng), lambda thing: plan.on_wall(thing, sides[int(rng.integers(2))])
        )
        plan.some(0.4, lambda: decor.picture(rng), lambda thing: plan.on_wall(thing, sides[int(rng.integers(2))]))
    add_radiators(plan, openings)
    for u in np.arange(x[0] + 1.0, x[1] - 0.7, rng.uniform(2.2, 3.5)):
        plan.put(decor.ceiling_panel(rng, plan.height), float(u), shift, float(rng.choice([0.0, 90.0])), check=False)
    return plan


def garage(rng: np.random.Generator) -> Plan:
    x0 = -float(rng.uniform(0.6, 1.4))
    side = 1.0 if rng.random() < 0.5 else -1.0
    wide, narrow = float(rng.uniform(3.4, 4.2)), float(rng.uniform(1.7, 2.4))
    y = (-narrow, wide) if side > 0 else (-wide, narrow)
    x = (x0, x0 + float(rng.uniform(6.4, 8.0)))
    plan = Plan(rng, x, y, float(rng.uniform(2.4, 3.2)), person_space())
    gate: Wall = "far" if rng.random() < 0.6 else "near"
    gap = side * (wide - 1.75)
    openings = [Opening("garage door", gate, float(gap), 2.5, 0.0, 2.1)]
    if rng.random() < 0.6:
        openings += add_windows(plan, "right" if side > 0 else "left", 1, openings)
    if rng.random() < 0.7:
        wall: Wall = "right" if side > 0 else "left"
        door = Opening("door", wall, float(rng.uniform(x[0] + 0.7, x[1] - 0.7)), 0.9, 0.0, 2.03)
        if all(o.wall != wall or abs(o.u - door.u) > 0.5 * (o.width + door.width) + 0.2 for o in openings):
            openings.append(door)
    enclose(plan, openings, walls=pick(rng, "bare concrete", "brickwork", "masonry"), floor="bare concrete",
        ceiling=pick(rng, "bare concrete", "masonry"), skirting=None)  # fmt: skip
    if rng.random() < 0.85:
        for _ in range(8):
            car = vehicles.car(rng)
            off = side * (1.25 + car.width / 2 + rng.uniform(0.0, 0.4))
            if plan.put(car, rng.uniform(x[0] + 2.5, x[1] - 2.5), off, float(rng.choice([90.0, -90.0]))):
                break
    for _ in range(int(rng.integers(2, 5))):
        plan.at_wall(shelves.open_shelf(rng, width=float(rng.uniform(0.8, 1.6))))
    plan.some(0.7, lambda: laboratory.lab_bench(rng, float(rng.uniform(1.2, 2.0))), plan.at_wall)
    plan.some(0.6, lambda: buildings.tool_wall(rng),
        lambda thing: any(plan.on_wall(thing, w) for w in ("far", "left", "right", "near")))  # fmt: skip
    for _ in range(int(rng.integers(1, 3))):
        plan.at_wall(vehicles.bicycle(rng), gap=0.1) or _along(plan)
    plan.some(0.7, lambda: buildings.tyres(rng), lambda thing: plan.at_wall(thing, gap=0.05))
    plan.some(0.5, lambda: outdoors.wheelie_bin(rng), plan.at_wall)
    plan.some(0.4, lambda: buildings.ladder(rng), lambda thing: plan.at_wall(thing, gap=0.05))
    plan.some(0.5, lambda: storage.cupboard(rng), plan.at_wall)
    plan.put(
        decor.ceiling_panel(rng, plan.height), 0.5 * sum(x), 0.5 * sum(y), float(rng.choice([0.0, 90.0])), check=False
    )
    return plan


def _along(plan: Plan) -> bool:
    """Place a bicycle along a wall."""
    one = vehicles.bicycle(plan.rng)
    for _ in range(10):
        u = float(plan.rng.uniform(plan.x[0] + 1.0, plan.x[1] - 1.0))
        v = plan.y[0] + 0.4 if plan.rng.random() < 0.5 else plan.y[1] - 0.4
        if plan.put(one, u, v, 90.0):
            return True
    return False
