"""Table of materials, each with its permittivity model and source.

To add a material, add an entry `name: (model, source)` to :data:`TABLE`, with a model of `scene/permittivity.py`;
a building material of ITU-R P.2040 goes into :data:`_ITU`, other spellings into `material_words.py`.
Actors, scenes and `rfgen_sionna.scene.MATERIALS` then take it by that name.
"""

from __future__ import annotations

from rfgen_sionna.scene.earth_surface import Ice, Snow, Soil, Water
from rfgen_sionna.scene.permittivity import ColeCole, Conductor, LossTangent, Permittivity, PowerLaw

_P2040 = "ITU-R P.2040-4 (09/2025), table 3"  # its ranges are indicative, except for the three grounds
_GABRIEL = "S. Gabriel, R. W. Lau, C. Gabriel, Phys. Med. Biol. 41 (1996) 2271, four Cole-Cole terms, "
_ASSUMED = "assumed by this project, no measurement in the millimetre-wave bands at hand: "
_P527 = "ITU-R P.527-6 (09/2021), "
_RIDDLE = "B. Riddle, J. Baker-Jarvis, J. Krupka, IEEE Trans. Microwave Theory Tech. 51 (2003) 727, "
_FLAT = "; taken as constant over the range, as PTFE's is from 10 to 110 GHz"
_ZECHMEISTER = (
    "J. Zechmeister, J. Lacik, Complex relative permittivity measurement of selected 3D-printed materials up to 10 "
    "GHz, Brno University of Technology: eps' 2.55-2.95 and eps'' 0.007-0.08 of solid prints, of which this is a middle"
)
_MIXED = ", mixed with air by Looyenga's rule (Physica 31 (1965) 401)"
_MILLIMETRE = ((10e9, 110e9),)


def _mixed(real: float, tangent: float, share: float) -> LossTangent:
    """Mixture of a `share` of the volume of a material with air, by Looyenga's rule."""
    eps = (1.0 - share + share * complex(real, -real * tangent) ** (1.0 / 3.0)) ** 3
    return LossTangent(eps.real, -eps.imag / eps.real, _MILLIMETRE)


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
    "denim": (_mixed(3.0, 0.08, 0.6), _ASSUMED + "cotton fibre (eps' 3, loss tangent 0.08), 60 %" + _MIXED),
    "wool": (_mixed(3.0, 0.08, 0.25), _ASSUMED + "fibre (eps' 3, loss tangent 0.08), a quarter" + _MIXED),
    "paper": (LossTangent(2.8, 0.08, _MILLIMETRE), _ASSUMED + "dense paper and board of cellulose, a few percent damp"),
    "cardboard": (_mixed(2.8, 0.08, 0.25), _ASSUMED + "corrugated board, a quarter paper (eps' 2.8)" + _MIXED),
    "foam": (
        LossTangent(1.1, 0.005, _MILLIMETRE),
        _ASSUMED + "polyurethane upholstery foam, air with a few percent of polymer",
    ),
    "plastic": (
        LossTangent(2.7, 0.01, _MILLIMETRE),
        _ASSUMED + "housings of ABS or polycarbonate, non-polar enough to be flat over the band",
    ),
    "abs": (LossTangent(2.7, 0.008, _MILLIMETRE), _RIDDLE + "at 11 GHz" + _FLAT),
    "pla": (LossTangent(2.75, 0.012, _MILLIMETRE), _ZECHMEISTER + _FLAT),
    "pet": (LossTangent(2.85, 0.01, _MILLIMETRE), _ZECHMEISTER + _FLAT),
    "pmma": (
        LossTangent(2.61, 0.01, _MILLIMETRE),
        _RIDDLE + "at 11 GHz; ITU-R P.2040-4 has eps' 2.58 and a loss tangent of 0.015 at 110 GHz" + _FLAT,
    ),
    "polycarbonate": (
        LossTangent(2.76, 0.007, _MILLIMETRE),
        _RIDDLE + "eps' at 11 GHz; loss tangent assumed, published values are 0.005-0.01" + _FLAT,
    ),
    "pvc": (LossTangent(2.71, 0.006, _MILLIMETRE), _RIDDLE + "at 11 GHz" + _FLAT),
    "pom": (LossTangent(2.73, 0.006, _MILLIMETRE), _RIDDLE + "at 11 GHz" + _FLAT),
    "polyethylene": (LossTangent(2.37, 0.0002, _MILLIMETRE), _RIDDLE + "high density, at 11.3 GHz" + _FLAT),
    "polypropylene": (LossTangent(2.27, 0.0001, _MILLIMETRE), _RIDDLE + "at 9.4 GHz" + _FLAT),
    "polystyrene": (
        LossTangent(2.505, 0.00025, _MILLIMETRE),
        "Abbas, 26-40 GHz, as quoted in the permittivity data of Chungbuk National University" + _FLAT,
    ),
    "styrofoam": (
        _mixed(2.505, 0.00025, 0.03),
        _ASSUMED + "expanded polystyrene of 30 kg/m³, 3 % of polystyrene" + _MIXED,
    ),
    "nylon": (
        LossTangent(3.0, 0.018, _MILLIMETRE),
        "Abbas, 26-40 GHz, as quoted in the permittivity data of Chungbuk National University" + _FLAT,
    ),
    "ptfe": (
        LossTangent(2.05, 0.0005, _MILLIMETRE),
        "Elhawil, Proc. Symp. IEEE/LEOS Benelux (2007), 70-110 GHz; " + _RIDDLE + "has 2.05 at 10 GHz",
    ),
    "carbon_fibre": (
        Conductor(1.0, 1e4, _MILLIMETRE),
        _ASSUMED + "woven laminate of 1e4 S/m in its plane, which reflects like metal, as measured at 60 GHz by E. "
        "Zöchmann et al., Prog. Electromagn. Res. M 67 (2018) 1; unidirectional plies are anisotropic",
    ),
    "ceramic": (LossTangent(5.5, 0.01, _MILLIMETRE), _ASSUMED + "glazed stoneware and porcelain: tiles, cups, basins"),
    "rubber": (LossTangent(3.0, 0.05, _MILLIMETRE), _ASSUMED + "tyres and soles, filler content changes it"),
    "leather": (LossTangent(2.5, 0.07, _MILLIMETRE), _ASSUMED + "upholstery and shoes"),
    "soil": (
        LossTangent(4.0, 0.15, _MILLIMETRE),
        _ASSUMED + "dry loam or sand with a few percent of water; wet soil reflects more",
    ),
    "dry_soil": (Soil(moisture=0.05), _P527 + "section 5.2: silty loam, 20 °C, 5 % of its volume water"),
    "wet_soil": (Soil(moisture=0.3), _P527 + "section 5.2: silty loam, 20 °C, 30 % of its volume water"),
    "water": (Water(), _P527 + "section 5.1.1: two Debye relaxations, 20 °C (temperature=…)"),
    "sea_water": (Water(salinity=35.0), _P527 + "section 5.1.2: 35 g/kg of salt, 20 °C (temperature=…)"),
    "ice": (Ice(), _P527 + "section 5.1.3.1: pure ice, -10 °C (temperature=…)"),
    "snow": (Snow(), _P527 + "section 5.1.4.1: dry snow of 0.3 g/cm³, -10 °C (temperature=…)"),
    "wet_snow": (Snow(0.0, liquid=0.05), _P527 + "section 5.1.4.2: 0.3 g/cm³, 5 % of its volume water, 0 °C"),
    "vegetation": (
        LossTangent(8.0, 0.5, _MILLIMETRE),
        _ASSUMED + "fresh leaves and grass, mostly water, in which bands above 30 GHz find eps' 8-20 and as much loss",
    ),
}
