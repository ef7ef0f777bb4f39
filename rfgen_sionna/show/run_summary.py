"""Summary of a run as text."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from rfgen_sionna.dataset import Run, RunFormatError, open_run
from rfgen_sionna.show.capture_summary import capture_lines
from rfgen_sionna.show.displayable import Displayable
from rfgen_sionna.signal.formats import Capture


def radar_line(run: Displayable | Capture) -> str:
    """The radar's configuration in one line."""
    radar = run.radar
    wave = radar.waveform
    low, high = wave.sampled_band
    sent = f"{len(radar.tx_positions)} Tx"
    if wave.slots:
        kinds = f", {len(wave.profiles)} kinds of chirps" if wave.other_profiles else ""
        sent = f"{wave.num_slots} slots of {len(radar.tx_positions)} Tx ({wave.multiplexing}{kinds})"
    cell = f"{radar.range_resolution * 100:.1f} cm × " if np.isfinite(radar.range_resolution) else ""
    return (
        f"{radar.name} · {radar.preset} · {low / 1e9:.2f}–{high / 1e9:.2f} GHz · "
        f"{wave.num_loops} loops × {sent} × {len(radar.rx_positions)} Rx × "
        f"{wave.num_samples} {'real ' if radar.adc.real else ''}samples · "
        f"cell {cell}{radar.velocity_resolution * 100:.1f} cm/s"
    )


def summary(run: Run | Capture | str | os.PathLike[str]) -> str:
    """Summary of a run, open or given by its path, or of a capture: contents, sizes and seeds, a few lines of plain
    text a radar. That of a capture reads its samples once."""
    if isinstance(run, Capture):
        files, described, *others = capture_lines(run)
        return _table([files, described, ("radar", radar_line(run)), *others])
    if isinstance(run, Run):
        return "\n\n".join(map(_summary, run.radars.values()))
    with open_run(run) as source:
        return "\n\n".join(map(_summary, source.radars.values()))


def _summary(source: Run) -> str:
    radar, times = source.radar, source.frame_times
    seeds = ", ".join(f"{name} {'-' if seed is None else seed}" for name, seed in source.seeds.items())
    step = f", one each {np.median(np.diff(times)) * 1e3:g} ms" if len(times) > 1 else ""
    frames = f"{len(source)} frames{step}"
    samples = ("stores", f"{', '.join(source.contents)}; {frames}")
    if "adc" in source.contents:
        shape = " × ".join(map(str, source.adc.shape))
        samples = ("ADC cube", f"{shape} (frame, chirp, tx, rx, sample) {source.adc.dtype}, {frames}")
    written = f", written {source.created}" if source.created else ""
    place = ", ".join(f"{x:g}" for x in radar.position)
    angles = ", ".join(f"{x + 0:.1f}" for x in np.degrees(radar.orientation).round(1))
    limits = f"reaches {radar.max_range:.2f} m and ±{radar.max_velocity:.2f} m/s"
    rows = [
        ("file", f"{source.path} ({source.path.stat().st_size / 1e6:.1f} MB){written}"),
        *([("recording", _recording_line(source))] if source.recording else []),
        ("prompt", source.prompt or "-"),
        ("negative", source.negative_prompt or "-"),
        ("environment", source.environment or "-"),
        ("radar", f"{'' if source.name == radar.name else f'{source.name}: '}{radar_line(source)}"),
        ("", f"at ({place}) m, yaw/pitch/roll ({angles})°, {limits}"),
        samples,
        ("PIR", _pir_line(source)),
    ]
    for actor in source.actors.values():
        try:
            counts = f"{len(actor.vertices(0))} vertices, {len(actor.faces)} faces, {len(actor.part_names)} parts"
        except RunFormatError:  # a recording may store joints only
            counts = "no mesh"
        skeleton = f", {len(actor.joint_names)} joints" if actor.joint_names else ""
        rows.append(("actor", f"{actor.name}: {actor.material}, {counts}{skeleton}"))
    for name, label in source.labels.items():
        unit = f" [{label.units}]" if label.units not in ("", "1") else ""
        rows.append(("label", f"{name} ({', '.join(label.dims)}){unit} {_span(label.values)}"))
    rows += [
        ("seeds", seeds or "-"),
        ("software", ", ".join(f"{name} {version}" for name, version in source.software.items())),
    ]
    report = f"\n\n{source.report}" if source.report else ""
    return _table(rows) + report


def _table(rows: Sequence[tuple[str, str]]) -> str:
    return "\n".join(f"{name:<12} {text}".rstrip() for name, text in rows)


def _recording_line(run: Run) -> str:
    """What the recipe of a data set said of a recording."""
    said = run.recording
    number, split, attempt = said.get("number", "-"), said.get("split", "-"), said.get("attempt", "-")
    return f"{number} of a data set, split {split}, attempt {attempt}; the file may hold others"


def _pir_line(run: Run) -> str:
    if not run.has_pir:
        return "none"
    pir = run.pir(0)
    rows, columns = pir.energy.shape
    return (
        f"{rows} × {columns} pixels, {pir.fov_deg[0]:g}° × {pir.fov_deg[1]:g}°, {pir.projection}; "
        "energy, time of arrival, velocity"
    )


def _span(values: np.ndarray) -> str:
    if values.dtype.kind == "O":
        return ", ".join(sorted({str(value) for value in values.flat}))
    finite = values[np.isfinite(values)]
    return f"{finite.min():.3g} … {finite.max():.3g}" if finite.size else "unknown"
