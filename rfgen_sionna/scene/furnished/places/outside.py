"""Streets, playgrounds and open fields."""

from __future__ import annotations

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.furnished.layout import Plan, person_space
from rfgen_sionna.scene.furnished.piece import Piece, pick
from rfgen_sionna.scene.furnished.pieces import buildings, outdoors, playing, seating, vehicles
from rfgen_sionna.scene.furnished.shapes import box, joined, quad, sheet

GROUND_REACH = 45.0
"""Reach of the ground around the radar [m]; returns from further away are negligible."""


def add_ground(plan: Plan, finish: str, x: tuple[float, float], y: tuple[float, float], name: str = "ground") -> None:
    """Add a level rectangle of ground."""
    plan.shell.append(
        (name, quad([(x[0], y[0], 0.0), (x[1], y[0], 0.0), (x[1], y[1], 0.0), (x[0], y[1], 0.0)]).of(finish))
    )


def street(rng: np.random.Generator) -> Plan:
    """A road along x between pavements and houses."""
    road, walk = float(rng.uniform(5.5, 7.5)), float(rng.uniform(1.8, 3.0))
    garden = float(rng.choice([0.0, rng.uniform(1.5, 4.0)]))
    # The radar stands on the road or on a pavement, never where a kerb would be underfoot.
    spots = [rng.uniform(-1, 1) * max(road / 2 - 1.5, 0.0)]
    if walk > 2.9:
        spots.append(road / 2 + walk / 2 + 0.1)
    middle = -float(spots[int(rng.integers(len(spots)))])
    edge = road / 2 + walk + garden
    x = (-9.0, float(rng.uniform(28.0, 40.0)))
    plan = Plan(rng, x, (middle - edge - 10.0, middle + edge + 10.0), 9.0, person_space())
    plan.stand = (x[0] + 3.0, 0.6 * x[1]), (middle - road / 2 - walk, middle + road / 2 + walk)
    add_ground(plan, "asphalt", (-GROUND_REACH, GROUND_REACH), (middle - road / 2, middle + road / 2), "road")
    for s in (-1, 1):
        a, b = sorted((middle + s * road / 2, middle + s * (road / 2 + walk)))
        add_ground(plan, "paving", (-GROUND_REACH, GROUND_REACH), (a, b), "pavement")
        c, d = sorted((middle + s * (road / 2 + walk), middle + s * GROUND_REACH))
        add_ground(plan, pick(rng, "grass", "paving"), (-GROUND_REACH, GROUND_REACH), (c, d))
        kerb = middle + s * (road / 2 + 0.07)
        plan.shell.append(
            ("kerb", box((-GROUND_REACH, kerb - 0.07, 0.0), (GROUND_REACH, kerb + 0.07, 0.11)).of("stone"))
        )
    for s in (-1, 1):
        u = x[0] - rng.uniform(0, 3)
        while u < x[1] - 6.0:
            width = float(rng.uniform(7.0, 13.0))
            if rng.random() < 0.9:
                home = buildings.house(rng, width)
                v = middle + s * (edge + home.depth / 2 + rng.uniform(0.0, 0.5))
                plan.put(home, float(u + width / 2), v, 0.0 if s < 0 else 180.0, within=False)
            u += width + float(rng.choice([0.02, rng.uniform(1.0, 4.0)])) + 0.05
    for s in (-1, 1):  # along the kerb: parked cars on the road, lamps and trees on the pavement
        facing = 90.0 if s > 0 else -90.0
        for u in np.arange(x[0] + 2.0, x[1] - 3.0, 5.6):
            if rng.random() < 0.45:
                one = vehicles.car(rng)
                plan.put(one, float(u + rng.uniform(-0.4, 0.4)), middle + s * (road / 2 - one.width / 2 - 0.25), facing)
        edge_of_walk, turn = middle + s * (road / 2 + 0.45), 180.0 if s > 0 else 0.0
        for u in np.arange(x[0] + rng.uniform(0, 5), x[1], rng.uniform(9, 14)):
            plan.put(outdoors.lamp_post(rng), float(u), edge_of_walk, turn)
        if rng.random() < 0.6:
            for u in np.arange(x[0] + rng.uniform(2, 7), x[1], rng.uniform(6, 10)):
                plan.put(outdoors.tree(rng), float(u), edge_of_walk + s * 0.15, float(rng.uniform(0, 360)))
        back = middle + s * (road / 2 + walk - 0.35)
        for _ in range(int(rng.integers(1, 4))):
            thing = (outdoors.litter_bin, seating.bench, vehicles.bicycle, outdoors.wheelie_bin)[int(rng.integers(4))](
                rng
            )
            turned = turn + 90.0 if thing.kind == "bicycle" else turn
            plan.put(thing, float(rng.uniform(x[0] + 1, x[1] - 8)), back, turned)
        for _ in range(int(rng.integers(0, 3))):
            plan.put(outdoors.sign(rng), float(rng.uniform(x[0] + 1, x[1] - 8)), edge_of_walk,
                float(rng.choice([90.0, -90.0])))  # fmt: skip
        if garden > 1.4:
            v = middle + s * (road / 2 + walk + 0.5)
            for u in np.arange(x[0] + 2, x[1] - 4, 5.0):
                kind = rng.random()
                if kind < 0.35:
                    plan.put(outdoors.hedge(rng, 4.0), float(u), v, turn)
                elif kind < 0.6:
                    plan.put(outdoors.fence(rng, 4.2), float(u), v, turn)
                elif kind < 0.8:
                    plan.put(outdoors.bush(rng), float(u), v + s * 0.4, 0.0)
    return plan


def playground(rng: np.random.Generator) -> Plan:
    """Equipment about a free place, with a fence or a hedge and trees around."""
    size = float(rng.uniform(10.0, 15.0))
    x, y = (-4.0, 2 * size - 6.0), (-size, size)
    plan = Plan(rng, x, y, 6.0, person_space())
    plan.stand = (-3.5, 9.0), (-7.0, 7.0)
    add_ground(plan, pick(rng, "grass", "sand", "soil"), x, y)
    far, outer = (-GROUND_REACH, GROUND_REACH), pick(rng, "grass", "paving", "grass")
    for a, b in (
        (far, (y[1], GROUND_REACH)),
        (far, (-GROUND_REACH, y[0])),
        ((-GROUND_REACH, x[0]), y),
        ((x[1], GROUND_REACH), y),
    ):
        add_ground(plan, outer, a, b)
    makers = [playing.swing, playing.slide, playing.seesaw, playing.climbing_frame, playing.spring_rider,
        playing.sandpit, playing.goal, playing.basketball_hoop]  # fmt: skip
    chances = (0.9, 0.9, 0.6, 0.8, 0.7, 0.5, 0.25, 0.25)
    for i in rng.permutation(len(makers)).tolist():
        for _ in range(2 if i in (0, 1, 4) else 1):
            if rng.random() < chances[i]:
                _near(plan, makers[i](rng))
    for _ in range(int(rng.integers(1, 4))):
        plan.anywhere(seating.bench(rng))
    plan.some(0.7, lambda: outdoors.litter_bin(rng), plan.anywhere)
    border = pick(rng, "fence", "hedge", "nothing")
    if border != "nothing":
        make = outdoors.fence if border == "fence" else outdoors.hedge
        for u in np.arange(x[0] + 2.5, x[1] - 2.0, 5.0):
            for v, turn in ((y[0] + 0.5, 0.0), (y[1] - 0.5, 180.0)):
                if rng.random() < 0.93:
                    plan.put(make(rng, 4.8), float(u), v, turn)
        for v in np.arange(y[0] + 3.5, y[1] - 3.0, 5.0):
            plan.put(make(rng, 4.8), x[1] - 0.5, float(v), 90.0)
    for _ in range(int(rng.integers(2, 7))):
        plan.anywhere(outdoors.tree(rng))
    for _ in range(int(rng.integers(0, 4))):
        plan.anywhere(outdoors.bush(rng))
    if rng.random() < 0.5:
        for u in np.arange(x[0], x[1] - 4, 12.0):
            home = buildings.house(rng, float(rng.uniform(8, 11)))
            plan.put(home, float(u + 5), y[1] + home.depth / 2 + 3.0, 180.0, within=False)
    return plan


def _near(plan: Plan, thing: Piece) -> bool:
    """Place a piece near the person, in view of the radar."""
    for _ in range(20):
        angle, reach = plan.rng.uniform(-2.2, 2.2), plan.rng.uniform(2.5, 9.5)
        spot = 3.0 + reach * np.cos(angle), reach * np.sin(angle)
        if plan.put(thing, float(spot[0]), float(spot[1]), float(plan.rng.uniform(0, 360))):
            return True
    return False


def open_field(rng: np.random.Generator) -> Plan:
    """Grass or bare soil with trees, bushes and fences, hills behind."""
    size = 22.0
    plan = Plan(rng, (-8.0, 2 * size - 8.0), (-size, size), 8.0, person_space())
    plan.stand = (-5.0, 10.0), (-8.0, 8.0)
    waves, phase = rng.uniform(0.05, 0.16, (4, 2)) * rng.choice([-1, 1], (4, 2)), rng.uniform(0, 2 * np.pi, 4)
    rise, deep = float(rng.uniform(0.5, 5.0)), 34.0

    def height(a: FloatArray, b: FloatArray) -> FloatArray:
        outside = np.maximum(np.maximum(np.abs(a - 14.0) - 22.5, np.abs(b) - 22.5), 0.0)
        hills = sum(1 + np.sin(w[0] * a + w[1] * b + p) for w, p in zip(waves, phase, strict=True)) / 4
        return np.asarray(rise * hills * np.minimum(outside / 20.0, 1.0) ** 2)

    ground = pick(rng, "grass", "grass", "soil")
    plan.shell.append(("ground", sheet(height, (14.0 - 22.5 - deep, -22.5 - deep), (14.0 + 22.5 + deep, 22.5 + deep),
        (26, 26)).of(ground)))  # fmt: skip
    if rng.random() < 0.4:
        a = float(rng.uniform(-6, 6))
        strip = [box((s, a - 0.9, 0.0), (s + 0.9, a + 0.9, 0.012)) for s in np.arange(-8, 36, 0.9)]
        plan.shell.append(("path", joined(strip).of("sand")))
    for _ in range(int(rng.integers(1, 8))):
        plan.anywhere(outdoors.tree(rng))
    for _ in range(int(rng.integers(1, 7))):
        _near(plan, outdoors.bush(rng))
    for _ in range(int(rng.integers(0, 6))):
        _near(plan, outdoors.stone(rng))
    if rng.random() < 0.6:
        y, turn = float(rng.uniform(4, 12) * rng.choice([-1, 1])), 0.0
        for u in np.arange(-5.0, 32.0, 4.4):
            plan.put(outdoors.fence(rng, 4.3), float(u), y, turn)
    if rng.random() < 0.4:
        x = float(rng.uniform(9, 20))
        for v in np.arange(-18.0, 18.0, 4.4):
            plan.put(outdoors.fence(rng, 4.3), x, float(v), 90.0)
    if rng.random() < 0.45:
        for _ in range(int(rng.integers(2, 7))):
            plan.anywhere(outdoors.hay_bale(rng))
    if rng.random() < 0.3:
        _near(plan, buildings.shed(rng))
    if rng.random() < 0.3:
        plan.put(
            outdoors.hedge(rng, 14.0), float(rng.uniform(6, 16)), float(rng.uniform(8, 16) * rng.choice([-1, 1])), 0.0
        )
    return plan
