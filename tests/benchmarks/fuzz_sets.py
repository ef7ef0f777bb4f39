"""Data sets of strangers: mutated shards, indices, checksums and recipes, each read in a process that may end.

    python -m tests.benchmarks.fuzz_sets                      10,000 mutations, results/fuzz_sets.json
    python -m tests.benchmarks.fuzz_sets --count 200 --out DIR

Forms: "set": a byte string of any file is changed, and the set is opened and read; "index": SQLite sees the changed
bytes, as of an index whose checksum was written anew; "recipe": the recipe is parsed; "signed": the checksums are
written anew, and the set is opened as a stranger's, whose shards are read in a process of their own first; "shard":
the changed shard is read by libhdf5 in that process, without any checksum.

Outcomes: "refused" (an error that says why), "same" (what was read is as it was; a recipe can be read), "other"
(something else was read: never without a new checksum), "ended" (the process that read ended: never but of "shard").
"""

from __future__ import annotations

import argparse
import io
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path

import numpy as np

from rfgen_sionna.dataset import STANDARD_LABELS, ActorInfo, RunInfo, RunWriter, open_dataset
from rfgen_sionna.dataset.checksums import write_sums
from rfgen_sionna.dataset.recording_digest import examine
from rfgen_sionna.dataset.set_index import INDEX, read_index, write_index
from rfgen_sionna.dataset.shards import assemble_shard
from rfgen_sionna.dataset.verified_files import VerifiedFiles, examined
from rfgen_sionna.radar import Radar

RESULT = Path(__file__).parent / "results" / "fuzz_sets.json"
SHARES = {"set": 0.4, "index": 0.25, "recipe": 0.1, "shard": 0.2, "signed": 0.05}
"""Shares of the forms in all mutations."""
RECIPE = (Path(__file__).parents[2] / "examples" / "recipes" / "tiny.toml").read_bytes()
SHARD = "shard-00000.h5"


def make_set(folder: Path, recordings: int = 3, frames: int = 2) -> None:
    """A small set: a person, labels, words, compressed blocks."""
    folder.mkdir()
    full = Radar.load("awr1843", preset="mmmesh", position=(0, 0, 1), look_at=(3, 1, 1))
    radar = replace(full, waveform=replace(full.waveform, num_loops=8, num_samples=32))
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]], np.int32)
    person = ActorInfo("person", "skin", faces, 4, joint_names=("pelvis", "hand"))
    labels = {name: STANDARD_LABELS[name] for name in ("action", "position")}
    adc = {"bits": 12, "full_scale_dbm": -30.0, "real": False, "iq_swap": False}
    parts = {}
    for number in range(recordings):
        spec = {"number": number, "split": "train" if number else "test", "seed": 5 + number, "bodies": [{"seed": 1}]}
        info = RunInfo(
            radar, prompt="a person waving", actors=(person,), labels=labels, recording=spec,
            receiver={"thermal_noise": True, "adc": adc},
        )  # fmt: skip
        rng = np.random.default_rng(number)
        parts[number] = folder / f"{number}.h5"
        with RunWriter(parts[number], info, words=True, compressed=True, dated=False) as writer:
            for frame in range(frames):
                levels = np.rint(rng.normal(0, 20, (*radar.frame_shape, 2)))
                samples = (levels[..., 0] + 1j * levels[..., 1]) * (1e-3 / 2048)
                corners = rng.random((4, 3))
                writer.append(
                    samples, time=0.1 * frame, vertices={"person": corners}, joints={"person": corners[:2]},
                    labels={"action": ["wave"], "position": corners[:1]}, full_scale=1e-3,
                )  # fmt: skip
    assemble_shard(folder / SHARD, parts, {"recipe": RECIPE.decode()})
    for part in parts.values():
        part.unlink()
    (folder / "recipe.toml").write_bytes(RECIPE)
    (folder / "README.md").write_text("A small set.\n")
    write_index(folder, {"recipe": "0" * 64})
    write_sums(folder)


def mutated(data: bytes, rng: random.Random) -> bytes:
    """Bytes with one to four bits flipped, bytes set, a stretch taken out, put in, doubled or cut off."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        place, kind = rng.randrange(max(len(out), 1)), rng.randrange(8)
        if rng.random() < 0.3:
            place = rng.randrange(min(4096, max(len(out), 1)))  # headers
        length = rng.choice((1, 2, 4, 8, 64, 512))
        if kind <= 2 and out:
            out[place] ^= 1 << rng.randrange(8)
        elif kind == 3:
            out[place : place + length] = bytes(rng.choice((0, 0xFF, 0x7F)) for _ in range(length))
        elif kind == 4:
            out[place : place + length] = rng.randbytes(length)
        elif kind == 5:
            del out[place : place + length]
        elif kind == 6:
            out[place:place] = out[place : place + length] or rng.randbytes(length)
        else:
            del out[place:]
    return bytes(out)


def contents(folder: Path) -> str:
    """All that is read of a set, as a text."""
    found = []
    with open_dataset(folder) as recordings:
        found.append([repr(row) for row in recordings.rows] + [recordings.recipe_text, *map(str, recordings.failures)])
        for run in recordings:
            person = run.actors["person"]
            found.append(
                [
                    run.adc[:].tobytes().hex(), run.prompt, run.radar.to_dict(), run.frame_times.tolist(),
                    {name: label.values.tolist() for name, label in run.labels.items()},
                    person.vertices(0).tolist(), person.joints(1).tolist(), person.faces.tolist(), run.recording,
                ]
            )  # fmt: skip
    return json.dumps(found, default=repr)


VALUES = (
    "0", "-1", "1e308", "nan", "-inf", "1" * 20, "1e12", "1000000000", '""', '"x"', "[]", "{}", "[[[]]]", "true",
    "{range = [0, 1e9]}", "{range = [1, 0]}", "{grid = [1, 2, 3]}", "{choice = [], weights = []}",
    "{choice = [1], weights = [nan]}", '"' + "a" * 100_000 + '"', "[" * 50 + "]" * 50, "1979-05-27", '"../../passwd"',
)  # fmt: skip
"""Values in the place of those of a recipe."""


def with_other_values(text: str, rng: random.Random) -> str:
    """A recipe with one to three values replaced by others."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        places = [found.span() for found in re.finditer(r'(?<==)[^\n]+|[-\d.]+|"[^"\n]*"', text)]
        start, stop = rng.choice(places)
        text = text[:start] + rng.choice(VALUES) + text[stop:]
    return text


def _set_form(folder: Path, before: str, rng: random.Random) -> str:
    path = folder / rng.choice([SHARD, SHARD, INDEX, INDEX, "SHA256SUMS", "recipe.toml"])
    _put(path, mutated(path.read_bytes(), rng))
    return "same" if contents(folder) == before else "other"


def _index_form(folder: Path, before: str, rng: random.Random) -> str:
    known = read_index(folder)
    _put(folder / INDEX, mutated((folder / INDEX).read_bytes(), rng))
    return "same" if read_index(folder) == known else "other"


def _recipe_form(folder: Path, before: str, rng: random.Random) -> str:
    from rfgen_sionna.recipes import Recipe

    text = mutated(RECIPE, rng).decode() if rng.random() < 0.5 else with_other_values(RECIPE.decode(), rng)
    Recipe.parse(text, folder, check=False).recording(0)
    return "same"


def _signed_form(folder: Path, before: str, rng: random.Random) -> str:
    path = folder / SHARD
    _put(path, mutated(path.read_bytes(), rng))
    digests = write_sums(folder)
    (folder / ".verified").unlink()
    VerifiedFiles(folder, digests).check(SHARD)
    return "same" if contents(folder) == before else "other"


def _shard_form(folder: Path, before: str, rng: random.Random) -> str:
    path = folder / SHARD
    _put(path, mutated(path.read_bytes(), rng))
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        examine(str(path))
    return "same"


FORMS: dict[str, Callable[[Path, str, random.Random], str]] = {
    "set": _set_form, "index": _index_form, "recipe": _recipe_form, "signed": _signed_form, "shard": _shard_form,
}  # fmt: skip
REFUSALS = (ValueError, OSError, KeyError, TypeError, RuntimeError, IndexError)
"""Errors that a program can handle; the texts of those that are no ValueError or OSError are listed."""


def _put(path: Path, data: bytes) -> None:
    path.unlink()
    path.write_bytes(data)


def child(base: Path, form: str, seed: int, first: int, stop: int) -> None:
    """Try mutations `first` … `stop` - 1 and print the outcome of each."""
    before = contents(base)
    with tempfile.TemporaryDirectory() as folder:
        for number in range(first, stop):
            place = Path(folder) / "set"
            shutil.copytree(base, place, ignore=shutil.ignore_patterns(".verified"))
            VerifiedFiles(place, _digests(base)).note({SHARD: _digests(base)[SHARD]})
            try:
                text = FORMS[form](place, before, random.Random(f"{seed} {form} {number}"))
            except REFUSALS as error:
                # What libhdf5 cannot follow is a KeyError of h5py, in the process that examines.
                expected = isinstance(error, ValueError | OSError) or form == "shard"
                text = "refused" if expected else f"refused {type(error).__name__}: {str(error)[:80]}"
            shutil.rmtree(place)
            print(f"{number} {text}".replace("\n", " "), flush=True)


def _digests(folder: Path) -> dict[str, str]:
    lines = (folder / "SHA256SUMS").read_text().splitlines()
    return {line[66:]: line[:64] for line in lines if not line.startswith("#")}


def fuzz(base: Path, form: str, count: int, seed: int = 0) -> dict[str, int]:
    """Numbers of the outcomes of `count` mutations of a form; a process that ends is started again after it."""
    found: Counter[str] = Counter()
    done = 0
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    while done < count:
        command = [sys.executable, "-m", "tests.benchmarks.fuzz_sets", "--child", form, str(base)]
        command += [str(seed), str(done), str(count)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
        output, errors = process.communicate()
        lines = [line for line in output.splitlines() if line.partition(" ")[0].isdigit()]
        for line in lines:
            found[line.partition(" ")[2]] += 1
        done += len(lines)
        if process.returncode and done < count:
            if process.returncode > 0 and "Error" in errors:
                found[f"error {errors.strip().splitlines()[-1][:160]}"] += 1
            else:
                found[f"ended {process.returncode}"] += 1
            done += 1
    return dict(sorted(found.items()))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--forms", nargs="*", default=list(SHARES))
    parser.add_argument("--out", type=Path, default=RESULT)
    parser.add_argument("--child", nargs=5)
    given = parser.parse_args()
    if given.child:
        form, base, *numbers = given.child
        child(Path(base), form, *map(int, numbers))
        return
    result: dict[str, object] = {"count": given.count, "seed": given.seed}
    with tempfile.TemporaryDirectory() as folder:
        base = Path(folder) / "base"
        make_set(base)
        assert not examined(base / SHARD)[0]
        for form in given.forms:
            start = time.perf_counter()
            outcomes = fuzz(base, form, max(1, round(given.count * SHARES[form])), given.seed)
            result[form] = outcomes
            print(form, outcomes, f"{time.perf_counter() - start:.0f} s", flush=True)
    given.out.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
