"""Living rooms and bedrooms."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.scene.furnished.layout import FACING, Item, Plan, Wall, from_item, person_space
from rfgen_sionna.scene.furnished.piece import Piece, pick
from rfgen_sionna.scene.furnished.pieces import decor, seating, shelves, storage, tables
from rfgen_sionna.scene.furnished.shell import Opening, add_door, add_windows, enclose


def room(
    rng: np.random.Generator, length: tuple[float, float], width: tuple[float, float], height: tuple[float, float]
) -> Plan:
    """An empty rectangular room around the radar, of random sizes in ranges [m]."""
    x0 = -rng.uniform(0.5, 1.3)
    across = rng.uniform(*width)
    shift = rng.uniform(-0.5, 0.5) * max(0.0, min(across - width[0], 1.2))
    return Plan(rng, (float(x0), float(x0 + rng.uniform(*length))), (float(shift - across / 2),
        float(shift + across / 2)), float(rng.uniform(*height)), person_space())  # fmt: skip


def doors_and_windows(plan: Plan, windows: tuple[int, int] = (1, 3)) -> list[Opening]:
    """A door, and windows in one or two walls."""
    found = [add_door(plan, ("near", "left", "right", "far"))]
    sides: list[Wall] = ["far", "left", "right"]
    for wall in plan.rng.permutation(sides)[: 1 + int(plan.rng.random() < 0.3)].tolist():
        found += add_windows(plan, wall, int(plan.rng.integers(windows[0], windows[1])), found)
    return found


def dining(rng: np.random.Generator) -> list[tuple[Piece, float, float, float]]:
    """A table with chairs, as a group."""
    table = tables.dining_table(rng)
    things = [(table, 0.0, 0.0, 0.0)]
    style = pick(rng, "slats", "padded", "shell")
    count = 2 if table.width < 1.6 else 3
    seed = int(rng.integers(2**31))
    for side in (-1, 1):
        for i in range(count):
            one = seating.chair(np.random.default_rng(seed), style)
            u = ((i + 0.5) / count - 0.5) * table.width
            v = side * (table.depth / 2 + one.depth / 2 + SEAT_GAP)
            things.append((one, u + rng.uniform(-0.03, 0.03), v, (180.0 if side > 0 else 0.0) + rng.uniform(-8, 8)))
    return things


SEAT_GAP = 0.06
"""Gap between a table and its chairs [m]."""


def place_group(plan: Plan, things: list[tuple[Piece, float, float, float]]) -> bool:
    """Place a group at a random spot, parallel to the walls."""
    for _ in range(20):
        x, y = plan.rng.uniform(*plan.x), plan.rng.uniform(*plan.y)
        if plan.group(things, float(x), float(y), float(plan.rng.choice([0.0, 90.0]))):
            return True
    return False


def wall_decoration(plan: Plan, pictures: int) -> None:
    walls: tuple[Wall, ...] = ("far", "left", "right")
    for _ in range(pictures):
        plan.on_wall(decor.picture(plan.rng), walls[int(plan.rng.integers(3))])
    if plan.rng.random() < 0.25:
        plan.on_wall(decor.wall_clock(plan.rng), "far")


def hang_lamp(plan: Plan) -> None:
    """Hang a lamp near the middle."""
    lamp = decor.ceiling_lamp(plan.rng, plan.height)
    x, y = 0.5 * sum(plan.x) + plan.rng.uniform(-0.4, 0.4), 0.5 * sum(plan.y)
    plan.put(lamp, float(x), float(y), 0.0, check=False)


def add_radiators(plan: Plan, openings: list[Opening]) -> None:
    """Add radiators under the windows with room for them."""
    for o in openings:
        if o.kind == "window" and plan.rng.random() < 0.6:
            low, high = plan.x if o.wall in ("left", "right") else plan.y
            heater = decor.radiator(plan.rng)
            share = (o.u - low - heater.width / 2) / max(high - low - heater.width, 1e-9)
            plan.put(heater, *plan.wall_spot(heater, o.wall, float(np.clip(share, 0, 1)), 0.05), FACING[o.wall])


def living_room(rng: np.random.Generator) -> Plan:
    plan = room(rng, (6.0, 8.6), (4.8, 6.6), (2.4, 2.9))
    openings = doors_and_windows(plan)
    enclose(
        plan, openings, floor=pick(rng, "floorboards", "floorboards", "carpet"), ceiling=pick(rng, "ceiling", "plaster")
    )
    opposite: dict[Wall, Wall] = {"left": "right", "right": "left", "far": "near", "near": "far"}
    sofa = plan.at_wall(seating.sofa(rng), ("left", "right", "far", "far"))
    if sofa is not None:
        wall = next(w for w, yaw in FACING.items() if abs(yaw - sofa.yaw) < 1)
        plan.at_wall(storage.tv_unit(rng), (opposite[wall],)) or plan.at_wall(storage.tv_unit(rng))
        table = tables.coffee_table(rng)
        plan.before(table, sofa, rng.uniform(0.35, 0.5)) or plan.before(table, sofa, 0.3, aside=rng.uniform(-1, 1))
        rug = decor.rug(rng)
        if _room_for(plan, sofa, rug):
            plan.put(rug, *from_item(sofa, 0.0, 0.5 * sofa.size[1] + 0.2 + rug.depth / 2), sofa.yaw, check=False)
    else:
        plan.at_wall(storage.tv_unit(rng))
    for _ in range(int(rng.integers(1, 3))):
        _corner(plan, seating.armchair(rng)) or plan.at_wall(seating.armchair(rng))
    plan.some(0.9, lambda: shelves.bookshelf(rng), plan.at_wall)
    plan.some(0.5, lambda: shelves.bookshelf(rng), plan.at_wall)
    plan.some(0.5, lambda: storage.chest(rng, "sideboard"), plan.at_wall)
    if rng.random() < 0.6:
        place_group(plan, dining(rng))
    plan.some(0.8, lambda: decor.floor_lamp(rng), lambda lamp: _corner(plan, lamp) or plan.at_wall(lamp))
    for _ in range(int(rng.integers(1, 4))):
        thing = decor.plant(rng)
        _corner(plan, thing) or plan.at_wall(thing)
    add_radiators(plan, openings)
    wall_decoration(plan, int(rng.integers(1, 4)))
    hang_lamp(plan)
    return plan


def _room_for(plan: Plan, item: Item, rug: Piece) -> bool:
    x, y = from_item(item, 0.0, 0.5 * item.size[1] + 0.2 + rug.depth / 2)
    half = 0.5 * max(rug.width, rug.depth)
    return plan.x[0] + half < x < plan.x[1] - half and plan.y[0] + half < y < plan.y[1] - half


def _corner(plan: Plan, thing: Piece) -> bool:
    """Place a piece in a corner, facing the middle."""
    gap = 0.08 + 0.25 * thing.depth
    spots = [(plan.x[1] - gap - thing.width / 2, plan.y[1] - gap - thing.depth / 2, 135.0),
        (plan.x[1] - gap - thing.width / 2, plan.y[0] + gap + thing.depth / 2, 45.0),
        (plan.x[0] + gap + thing.width / 2, plan.y[1] - gap - thing.depth / 2, -135.0),
        (plan.x[0] + gap + thing.width / 2, plan.y[0] + gap + thing.depth / 2, -45.0)]  # fmt: skip
    return any(plan.put(thing, *spots[i]) for i in plan.rng.permutation(4).tolist())


def bedroom(rng: np.random.Generator) -> Plan:
    plan = room(rng, (5.4, 6.8), (4.0, 5.2), (2.4, 2.8))
    # A bed is long: the room is either longer behind the person, or wide to one side.
    if rng.random() < 0.5:
        plan.x = plan.x[0], 6.55 + float(rng.uniform(0.1, 0.8))
    else:
        wide, narrow = float(rng.uniform(3.45, 4.0)), float(rng.uniform(1.7, 2.4))
        plan.y = (-narrow, wide) if rng.random() < 0.5 else (-wide, narrow)
    plan.stand = plan.x, plan.y
    openings = doors_and_windows(plan)
    enclose(plan, openings, floor=pick(rng, "carpet", "floorboards"), ceiling=pick(rng, "ceiling", "plaster"))
    for _ in range(4):
        one = seating.bed(rng)
        bed = plan.at_wall(one, ("far", "left", "right"), where=(0.2, 0.9)) or _along_a_wall(plan, one)
        if bed is not None:
            break
    if bed is not None:
        for side in (-1, 1):
            table = storage.nightstand(rng)
            off = side * (bed.size[0] / 2 + table.width / 2 + 0.05)
            plan.put(table, *from_item(bed, off, -(bed.size[1] - table.depth) / 2), bed.yaw)
    plan.at_wall(storage.wardrobe(rng))
    plan.some(0.8, lambda: storage.chest(rng), plan.at_wall)
    plan.some(0.5, lambda: storage.wardrobe(rng), plan.at_wall)
    plan.some(0.5, lambda: shelves.bookshelf(rng), plan.at_wall)
    plan.some(0.5, lambda: seating.armchair(rng), lambda thing: _corner(plan, thing))
    plan.some(0.5, lambda: decor.rug(rng), lambda rug: _before_bed(plan, rug))
    if rng.random() < 0.35:
        _desk(plan)
    plan.some(0.5, lambda: decor.floor_lamp(rng), lambda thing: _corner(plan, thing))
    plan.some(0.6, lambda: decor.plant(rng), lambda thing: _corner(plan, thing) or plan.at_wall(thing))
    add_radiators(plan, openings)
    wall_decoration(plan, int(rng.integers(1, 3)))
    hang_lamp(plan)
    return plan


def _before_bed(plan: Plan, rug: Piece) -> None:
    bed = next((item for item in plan.items if item.kind == "bed"), None)
    if bed is not None and _room_for(plan, bed, rug):
        plan.put(rug, *from_item(bed, 0.0, 0.5 * bed.size[1] + 0.2 + rug.depth / 2), bed.yaw, check=False)


def _along_a_wall(plan: Plan, thing: Piece) -> Item | None:
    """Place a piece with a side at one of the walls and the head in a corner."""
    ways: list[tuple[Wall, float]] = [(wall, turn) for wall in ("left", "right", "far") for turn in (90.0, -90.0)]
    for i in plan.rng.permutation(len(ways)).tolist():
        if _along_wall(plan, thing, *ways[i]):
            return plan.items[-1]
    return None


def _along_wall(plan: Plan, thing: Piece, wall: Wall, turn: float) -> bool:
    """Place a piece with a side at a wall and the head in a corner."""
    yaw = FACING[wall] + turn
    lying = Piece(thing.kind, thing.parts, thing.depth, thing.width, thing.bottom, thing.top)
    for share in (0.0, 1.0):
        x, y = plan.wall_spot(lying, wall, share)
        if plan.put(thing, x, y, yaw):
            return True
    return False


def _desk(plan: Plan) -> None:
    """Place a desk with a chair at a wall."""
    desk = plan.at_wall(tables.desk(plan.rng, screens=int(plan.rng.integers(0, 2))))
    if desk is not None:
        chair = seating.office_chair(plan.rng)
        plan.before(chair, desk, 0.17, yaw=180.0 + plan.rng.uniform(-22, 22))
