"""Integrate the truths that the benchmark keeps, or check them.

    python -m tests.benchmarks.keep_truth            what is missing in results/truth.json
    python -m tests.benchmarks.keep_truth --check    one answer of each body again, and compares
    python -m tests.benchmarks.keep_truth --take bench/truth.json    what a run of the benchmark had to integrate

The first time takes a quarter of an hour on two cores, most of it the car at 77 GHz.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from tests.benchmarks.errors import AdcCheck, Known, integrals
from tests.benchmarks.pareto import SAMPLES_CHECKED, STEP, STEPS
from tests.benchmarks.stored import SHIPPED, Store, as_text, read
from tests.benchmarks.subjects import BANDS, SPEED, SUBJECTS
from tests.benchmarks.truth import Probe

AGREE = 1e-6
"""Relative difference that two machines' sums may have."""


def keep(names: list[str]) -> None:
    """All that a run with seed 0 asks for."""
    used: set[str] = set()
    with TemporaryDirectory() as folder:
        extra = Path(folder) / "truth.json"
        for name in names:
            for band in BANDS[name]:
                subject, store, begin = SUBJECTS[name](band), Store(extra), time.perf_counter()
                if subject.quadrature is None:
                    continue
                Known(subject, STEP * np.arange(STEPS), store)
                check = AdcCheck(subject, 0, SAMPLES_CHECKED, store)
                for smooth in (True, False):
                    check.expected(smooth)
                used |= store.used
                found = read(SHIPPED) | read(extra)
                SHIPPED.write_text(as_text(found), encoding="utf-8")
                seconds = time.perf_counter() - begin
                print(f"{name} {band} GHz: {store.integrated} integrated, {seconds:.0f} s", flush=True)
    if names == list(SUBJECTS):
        left = {key: value for key, value in read(SHIPPED).items() if key in used}  # without what nothing asks for
        SHIPPED.write_text(as_text(left), encoding="utf-8")


def differences(names: list[str]) -> dict[str, float]:
    """Relative difference of each body's first answer to what is kept; those that are not kept are left out."""
    found = {}
    for name in names:
        for band in BANDS[name]:
            subject, store = SUBJECTS[name](band), Store()
            if subject.quadrature is None:
                continue
            probe = [Probe.channel(0.0 * SPEED * subject.towards, subject.frequency)]
            kept = integrals(subject, probe, store)
            if not store.integrated:
                again = integrals(subject, probe, Store(shipped=None))
                found[f"{name} {band} GHz"] = float(abs(again[0] / kept[0] - 1))
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="integrate one answer of each body again and compare")
    parser.add_argument("--scene", action="append", default=[], help="one of " + ", ".join(SUBJECTS))
    parser.add_argument("--take", type=Path, help="truth.json of a run with seed 0, to be kept as well")
    options = parser.parse_args()
    if options.take is not None:
        SHIPPED.write_text(as_text(read(SHIPPED) | read(options.take)), encoding="utf-8")
        return 0
    names = options.scene or list(SUBJECTS)
    if not options.check:
        keep(names)
        return 0
    found = differences(names)
    for name, difference in found.items():
        print(f"{name}: {difference:.1e}")
    return int(max(found.values(), default=0.0) > AGREE)


if __name__ == "__main__":
    sys.exit(main())
