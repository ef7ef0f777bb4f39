"""The shipped boards by name and band."""

from __future__ import annotations

import re
from difflib import get_close_matches
from pathlib import Path

from rfgen_sionna.radar.config import read_config
from rfgen_sionna.resources import UnknownResourceError, available, resolve

_NEUTRAL = re.compile(r"^demo|(boost|rfevm|evm)$")
"""Parts of vendors' names that boards of one kind have or lack."""
_DEVICES = (
    (re.compile(r"^[aix]wrl?6[48]|^bgt60"), (57e9, 64e9)),
    (re.compile(r"^[aix]wrl?(1[2-8]|2[0-9])|^mmwcas"), (76e9, 81e9)),
    (re.compile(r"^bgt24|2go"), (24e9, 24.25e9)),
)
"""Bands of device families [Hz] by their names: TI's xWR and xWRL numbers, Infineon's BGT numbers."""


def board_file(name: str) -> Path:
    """Path of a shipped board's file, by its name in any case, with or without the vendor's suffix (BOOST, EVM).

    TI's AWR and IWR boards of one number have the same antennas: "IWR1843BOOST" and "xwr1843" are the AWR1843BOOST.

    Raises
    ------
    UnknownResourceError
        No board, or more than one, has this name; the message lists those of the same band first.
    """
    names = available("radars")
    if name in names:
        return resolve("radars", name)
    wanted, plain = _shortened(name), _plain(name)
    found = [known for known in names if _shortened(known) == wanted]
    if not found:
        found = [known for known in names if _numbered(_shortened(known)) == _numbered(wanted)]
    if len(found) == 1:
        return resolve("radars", found[0])
    band = next((band for pattern, band in _DEVICES if pattern.search(plain)), None)
    near = boards_for(band, part=True) if band else ()
    stems = {_numbered(known): known for known in near or names}
    close = [stems[stem] for stem in get_close_matches(_numbered(plain), stems, n=1)]
    message = f"no radar is called {name!r}{f' (did you mean {close[0]!r}?)' if close else ''}; "
    if band and near:
        others = [known for known in names if known not in near]
        message += f"boards at {band[0] / 1e9:g} … {band[1] / 1e9:g} GHz: {', '.join(near)}; "
        message += f"at other frequencies: {', '.join(others)}"
    else:
        message += f"available: {', '.join(names)}"
    raise UnknownResourceError(message)


def boards_for(
    band: tuple[float, float],
    tx: int = 0,
    rx: int = 0,
    *,
    most_rx: int | None = None,
    real: bool = True,
    part: bool = False,
) -> tuple[str, ...]:
    """Names of the shipped boards that reach a band [Hz].

    Parameters
    ----------
    tx, rx
        Least numbers of elements.
    most_rx
        Largest number of receivers; None for any.
    real
        Whether boards with real samples count.
    part
        Whether a part of the band is enough.
    """
    found = []
    for name in available("radars"):
        table = read_config(resolve("radars", name))
        low, high = table["transmitter"]["frequency_range_hz"]
        inside = low < band[1] and band[0] < high if part else low <= band[0] and band[1] <= high
        transmitters, receivers = len(table["array"]["tx_names"]), len(table["array"]["rx_names"])
        enough = transmitters >= tx and rx <= receivers <= (receivers if most_rx is None else most_rx)
        if inside and enough and (real or not table["adc"].get("real", False)):
            found.append(name)
    return tuple(found)


def board_power(name: str) -> float | None:
    """Tx power of a shipped board [dBm]; None for others."""
    try:
        return float(read_config(board_file(name))["transmitter"]["power_dbm"])
    except UnknownResourceError:
        return None


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _shortened(name: str) -> str:
    return _NEUTRAL.sub("", _plain(name))


def _numbered(name: str) -> str:
    """Name without the letter that tells TI's automotive, industrial and general devices apart."""
    return re.sub("^[aix]wr", "xwr", name)
