"""Table of materials, each with its permittivity model and source.

To add a material, add an entry `name: (model, source)` to :data:`TABLE`, with a model of `scene/permittivity.py`;
a building material of ITU-R P.2040 goes into :data:`_ITU`, other spellings into :data:`ALIASES`.
Actors, scenes and `rfgen_sionna.scene.MATERIALS` then take it by that name.
"""

from __future__ import annotations

from rfgen_sionna.scene.permittivity import ColeCole, Conductor, LossTangent, Permittivity, PowerLaw

_P2040 = "ITU-R P.2040-4 (09/2025), table 3"  # its ranges are indicative, except for the three grounds
_GABRIEL = "S. Gabriel, R. W. Lau, C. Gabriel, Phys. Med. Biol. 41 (1996) 2271, four Cole-Cole terms, "
_ASSUMED = "assumed by this project, no measurement in the millimetre-wave bands at hand: "
_MILLIMETRE = ((10e9, 110e9),)

_ITU: dict[str, tuple[tuple[float, float, float, float, float, float], ...]] = {
    # (lowest GHz, highest GHz, a, b, c, d): eps' = a f^b, sigma = c f^d
    "vacuum": ((0.001, 100.0, 1.0, 0.0, 0.0, 0.0),),
    "concrete": ((1.0, 100.0, 5.24, 0.0, 0.0462, 0.7822), (110.0, 330.0, 5.17, 0.0, 0.0145, 1.09)),
    "brick": ((1.0, 40.0, 3.91, 0.0, 0.0238, 0.16), (110.0, 330.0, 4.15, 0.0, 0.0006, 1.5712)),
    "plasterboard": ((1.0, 100.0, 2.73, 0.0, 0.0085, 0.9395), (110.0, 330.0, 2.56, 0.0, 0.0001, 1.7799),
        (100.0, 400.0, 2.65, 0.0, 0.0002, 1.598)),
    "wood": ((0.001, 100.0, 1.99, 0.0, 0.0047, 1.0718), (110.0, 330.0, 1.82, 0.0, 0.004, 1.0761),
        (100.0, 400.0, 2.1183, 0.0, 0.0055, 1.1113)),
    "glass": ((0.1, 100.0, 6.31, 0.0, 0.0036, 1.3394), (220.0, 450.0, 5.79, 0.0, 0.0004, 1.658),
        (100.0, 400.0, 6.5767, 0.0, 0.0012, 1.4697)),
    "clear_acrylic": ((110.0, 330.0, 2.58, 0.0, 0.0001, 1.6524),),
    "ceiling_board": ((1.0, 100.0, 1.48, 0.0, 0.0011, 1.075), (220.0, 450.0, 1.52, 0.0, 0.0029, 1.029),
        (100.0, 400.0, 1.2567, 0.0, 0.00013, 1.454)),
    "chipboard": ((1.0, 100.0, 2.58, 0.0, 0.0217, 0.78), (100.0, 200.0, 2.16, 0.0, 0.0023, 1.359)),
    "plywood": ((1.0, 40.0, 2.71, 0.0, 0.33, 0.0), (110.0, 330.0, 1.94, 0.0, 0.0067, 0.9982),
        (100.0, 400.0, 2.17, 0.0, 0.0063, 1.045)),
    "marble": ((1.0, 60.0, 7.074, 0.0, 0.0055, 0.9262), (110.0, 330.0, 7.94, 0.0, 0.0001, 1.733),
        (100.0, 400.0, 8.62, 0.0, 0.0027, 1.15)),
    "floorboard": ((50.0, 100.0, 3.66, 0.0, 0.0044, 1.3515), (220.0, 300.0, 5.27, 0.0, 2.22e-17, 7.3413),
        (300.0, 400.0, 5.27, 0.0, 0.0003, 2.0298), (400.0, 450.0, 5.27, 0.0, 49.8726, 0.0),
        (100.0, 400.0, 3.1575, 0.0, 0.001675, 1.32775)),
    "vinyl_tile": ((1.0, 40.0, 3.62, 0.0, 0.0051, 0.8422),),
    "carpet_tile": ((1.0, 40.0, 2.08, 0.0, 0.0009, 0.82),),
    "asphalt_concrete": ((1.0, 40.0, 4.83, 0.0, 0.0108, 1.3969),),
    "metal": ((1.0, 100.0, 1.0, 0.0, 1e7, 0.0),),
    "very_dry_ground": ((1.0, 10.0, 3.0, 0.0, 0.00015, 2.52),),
    "medium_dry_ground": ((1.0, 10.0, 15.0, -0.1, 0.035, 1.63),),
    "wet_ground": ((1.0, 10.0, 30.0, -0.4, 0.15, 1.3),),
}  # fmt: skip

TABLE: dict[str, tuple[Permittivity, str]] = {  # new materials go here
    **{name: (PowerLaw(segments), _P2040) for name, segments in _ITU.items()},
    "pec": (
        Conductor(1.0, 1e15, ((1e6, 1e12),)),
        "perfect electric conductor: 1e15 S/m, 1e-6 dB from total reflection below 1 THz and finite in float32",
    ),
    "skin": (
        ColeCole(
            4.0, (32.0, 1100.0, 0.0, 0.0), (7.234e-12, 32.481e-9, 159.155e-6, 15.915e-3), (0.0, 0.2, 0.2, 0.2), 0.0002
        ),
        _GABRIEL + "dry skin",
    ),
    "wet_skin": (
        ColeCole(
            4.0, (39.0, 280.0, 3e4, 3e4), (7.958e-12, 79.577e-9, 1.592e-6, 1.592e-3), (0.1, 0.0, 0.16, 0.2), 0.0004
        ),
        _GABRIEL + "wet skin",
    ),
    "clothing": (
        LossTangent(1.7, 0.04, _MILLIMETRE),
        _ASSUMED + "woven cotton, about half fibre (eps' near 3) and half air; published values of garments at "
        "14-110 GHz scatter over eps' 1.3-2.2 and loss tangents 0.01-0.1 with weave and humidity",
    ),
    "foam": (
        LossTangent(1.1, 0.005, _MILLIMETRE),
        _ASSUMED + "polyurethane upholstery foam, air with a few percent of polymer",
    ),
    "plastic": (
        LossTangent(2.7, 0.01, _MILLIMETRE),
        _ASSUMED + "housings of ABS or polycarbonate, non-polar enough to be flat over the band",
    ),
    "rubber": (LossTangent(3.0, 0.05, _MILLIMETRE), _ASSUMED + "tyres and soles, filler content changes it"),
    "leather": (LossTangent(2.5, 0.07, _MILLIMETRE), _ASSUMED + "upholstery and shoes"),
    "soil": (
        LossTangent(4.0, 0.15, _MILLIMETRE),
        _ASSUMED + "dry loam or sand with a few percent of water; wet soil reflects more",
    ),
    "vegetation": (
        LossTangent(8.0, 0.5, _MILLIMETRE),
        _ASSUMED + "fresh leaves and grass, mostly water, in which bands above 30 GHz find eps' 8-20 and as much loss",
    ),
}

ALIASES: dict[str, str] = {
    "air": "vacuum", "free_space": "vacuum", "acrylic": "clear_acrylic", "aluminium": "metal", "aluminum": "metal",
    "asphalt": "asphalt_concrete", "car": "metal", "car_body": "metal", "carpet": "carpet_tile",
    "cotton": "clothing", "drywall": "plasterboard", "dry_skin": "skin", "fabric": "clothing", "human_skin": "skin",
    "perfect_conductor": "pec", "steel": "metal", "textile": "clothing", "upholstery": "clothing",
    "vinyl": "vinyl_tile",
}  # fmt: skip
