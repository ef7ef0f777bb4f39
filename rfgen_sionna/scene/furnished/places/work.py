"""Offices, laboratories and classrooms."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.scene.furnished.layout import FACING, Plan, Wall
from rfgen_sionna.scene.furnished.piece import Piece, pick
from rfgen_sionna.scene.furnished.pieces import decor, laboratory, seating, shelves, storage, tables
from rfgen_sionna.scene.furnished.places.homes import add_radiators, doors_and_windows, room, wall_decoration
from rfgen_sionna.scene.furnished.shell import enclose


def strip_lights(plan: Plan) -> None:
    """Add rows of lights under the ceiling."""
    for x in np.arange(plan.x[0] + 1.2, plan.x[1] - 0.7, 2.2):
        for y in (plan.y[0] * 0.5, plan.y[1] * 0.5):
            plan.put(decor.ceiling_panel(plan.rng, plan.height), float(x), float(y), 90.0, check=False)


def work_place(rng: np.random.Generator, screens: int | None = None) -> list[tuple[Piece, float, float, float]]:
    """A desk and a chair, as a group."""
    desk, chair = tables.desk(rng, screens), seating.office_chair(rng)
    return [(desk, 0.0, 0.0, 0.0), (chair, rng.uniform(-0.15, 0.15), desk.depth / 2 + chair.depth / 2 + 0.17,
        180.0 + rng.uniform(-22, 22))]  # fmt: skip


def group_at_wall(plan: Plan, things: list[tuple[Piece, float, float, float]]) -> bool:
    """Place a group whose first piece has its back to a wall."""
    first = things[0][0]
    walls = plan.rng.permutation(np.array(["left", "right", "far", "near"])).tolist()
    for i in range(14):
        wall = walls[i % 4]
        x, y = plan.wall_spot(first, wall, float(plan.rng.random()))
        if plan.group(things, x, y, FACING[wall]):
            return True
    return False


def office(rng: np.random.Generator) -> Plan:
    plan = room(rng, (6.6, 9.5), (5.6, 7.6), (2.5, 3.1))
    openings = doors_and_windows(plan, (2, 4))
    enclose(plan, openings, floor=pick(rng, "carpet", "linoleum"), ceiling="ceiling", skirting="plastic")
    desks = 0
    for _ in range(int(rng.integers(3, 7))):
        desks += group_at_wall(plan, work_place(rng))
    for _ in range(int(rng.integers(1, 3))):
        things = work_place(rng)
        for _ in range(25):
            x, y = rng.uniform(4.3, max(plan.x[1], 4.4)), rng.uniform(*plan.y)
            if plan.group(things, float(x), float(y), float(rng.choice([0.0, 90.0, 180.0, -90.0]))):
                break
    for _ in range(int(rng.integers(2, 5))):
        thing = storage.filing_cabinet(rng) if rng.random() < 0.5 else shelves.bookshelf(rng)
        plan.at_wall(thing)
    plan.some(0.5, lambda: storage.cupboard(rng), plan.at_wall)
    if rng.random() < 0.6:
        plan.on_wall(decor.whiteboard(rng), pick(rng, "left", "right", "far"))
    for _ in range(int(rng.integers(0, 3))):
        plan.at_wall(decor.plant(rng))
    plan.some(0.7, lambda: decor.waste_bin(rng), plan.at_wall)
    plan.some(0.4, lambda: decor.coat_rack(rng), lambda thing: plan.at_wall(thing, gap=0.1))
    plan.some(0.3, lambda: seating.chair(rng, "padded"), plan.at_wall)
    add_radiators(plan, openings)
    wall_decoration(plan, int(rng.integers(0, 2)))
    strip_lights(plan)
    return plan


def lab(rng: np.random.Generator) -> Plan:
    plan = room(rng, (5.6, 9.0), (4.8, 7.0), (2.7, 3.3))
    openings = doors_and_windows(plan, (2, 4))
    enclose(plan, openings, walls=pick(rng, "plaster", "masonry"), floor=pick(rng, "linoleum", "tiles"),
        ceiling="ceiling", skirting="plastic")  # fmt: skip
    for _ in range(int(rng.integers(3, 6))):
        bench = plan.at_wall(laboratory.lab_bench(rng))
        if bench is not None and rng.random() < 0.8:
            plan.before(seating.stool(rng), bench, 0.06, aside=float(rng.uniform(-0.3, 0.3) * bench.size[0]))
    plan.at_wall(decor.sink(rng))
    if plan.x[1] > 6.4:  # an island behind the person
        island = laboratory.lab_bench(rng, rng.uniform(1.4, 2.0))
        plan.put(island, rng.uniform(4.9, plan.x[1] - 1.2), rng.uniform(-0.5, 0.5), 90.0)
    for _ in range(int(rng.integers(1, 3))):
        plan.at_wall(storage.cupboard(rng, "cabinet"))
    plan.some(0.6, lambda: shelves.open_shelf(rng), plan.at_wall)
    for _ in range(2):
        plan.some(0.6, lambda: gas_bottle(rng), lambda thing: plan.at_wall(thing, gap=0.06))
    plan.some(0.5, lambda: decor.waste_bin(rng), plan.at_wall)
    add_radiators(plan, openings)
    strip_lights(plan)
    return plan


def gas_bottle(rng: np.random.Generator) -> Piece:
    from rfgen_sionna.scene.furnished.piece import piece
    from rfgen_sionna.scene.furnished.shapes import lathe

    r, h = 0.115, rng.uniform(1.3, 1.55)
    profile = [(0.9 * r, 0), (r, 0.03), (r, h - 0.15), (0.75 * r, h - 0.05), (0.3 * r, h), (0.3 * r, h + 0.07),
        (0.0, h + 0.07)]  # fmt: skip
    return piece("gas cylinder", [lathe(profile, 16).of(pick(rng, "metal", "painted metal"))])


def classroom(rng: np.random.Generator) -> Plan:
    plan = room(rng, (7.0, 9.5), (6.0, 8.0), (2.8, 3.3))
    openings = doors_and_windows(plan, (3, 5))
    enclose(plan, openings, floor=pick(rng, "linoleum", "floorboards"), ceiling="ceiling", skirting="plastic")
    board = decor.whiteboard(rng, rng.uniform(2.4, 3.6), pick(rng, "blackboard", "whiteboard"))
    wall: Wall = pick(rng, "far", "left", "right")
    # The pupils face the board: their desks' far edges towards it.
    facing = FACING[wall] + 180.0
    plan.on_wall(board, wall, 30)
    teacher = work_place(rng, screens=int(rng.integers(0, 2)))
    for _ in range(10):
        x, y = plan.wall_spot(teacher[0][0], wall, float(rng.random()), 1.0)
        if plan.group(teacher, x, y, FACING[wall] + 180.0):
            break
    width, style, seed = rng.uniform(1.1, 1.35), pick(rng, "slats", "shell"), int(rng.integers(2**31))
    pitch = width + rng.uniform(0.25, 0.45)
    rows = np.arange(plan.x[0] + 0.9, plan.x[1] - 0.5, rng.uniform(1.25, 1.5))
    columns = np.arange(plan.y[0] + 0.9, plan.y[1] - 0.6, pitch)
    if wall != "far":
        rows = np.arange(plan.x[0] + 0.9, plan.x[1] - 0.6, pitch)
        columns = np.arange(plan.y[0] + 0.9, plan.y[1] - 0.6, rng.uniform(1.25, 1.5))
    for x in rows:
        for y in columns:
            if rng.random() < 0.06:
                continue
            desk = tables.classroom_desk(rng, width, 0.55)
            things: list[tuple[Piece, float, float, float]] = [(desk, 0.0, 0.0, 0.0)]
            for u in (-0.25, 0.25):
                chair = seating.chair(np.random.default_rng(seed), style)
                away = desk.depth / 2 + chair.depth / 2 + rng.uniform(0.03, 0.12)
                things.append((chair, u * width, away, 180.0 + rng.uniform(-6, 6)))
            plan.group(things, float(x), float(y), facing + 180.0 if wall == "near" else FACING[wall] + 0.0)
    plan.some(0.8, lambda: storage.cupboard(rng), plan.at_wall)
    plan.some(0.6, lambda: shelves.bookshelf(rng), plan.at_wall)
    plan.some(0.4, lambda: decor.plant(rng), plan.at_wall)
    plan.some(0.5, lambda: decor.waste_bin(rng), plan.at_wall)
    add_radiators(plan, openings)
    wall_decoration(plan, int(rng.integers(0, 3)))
    strip_lights(plan)
    return plan
