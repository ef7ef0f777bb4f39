"""What is wrong with a method's answer: of instants, of the spectrum of a body that only translates, of ADC samples."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.signal.windows import blackman

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.records import RadarPaths, knot_weights
from rfgen_sionna.signal import synthesize
from tests.benchmarks import truth
from tests.benchmarks.measuring import timed
from tests.benchmarks.methods import Method, Traced, Tubes
from tests.benchmarks.stored import Store
from tests.benchmarks.subjects import SPEED, Subject, permittivity
from tests.benchmarks.truth import Probe

FAR = 150.0
"""Doppler [Hz] beyond the body's own that counts as spurious."""
FINER = 1.4
"""Times as dense along a line, for what the truth is known to. Half as many points tell nothing of a flat panel: the
phase over it asks for all of them."""


def slow_time(method: Method, times: FloatArray) -> ComplexArray:
    """(time,) channel at each time: instant by instant, but of the tracer from one trace."""
    if isinstance(method, Traced):
        traced = method.tracer.trace(times[0], times[-1])
        return np.sum([over_time(each.select(method.subject.counted(each)), times) for each in traced.actors], axis=0)
    return np.array([method(float(t)) for t in times])


def over_time(paths: RadarPaths, times: FloatArray) -> ComplexArray:
    """(time,) coherent sum of the first pair's paths, between their knots."""
    found = []
    for some in np.array_split(times, max(1, len(times) // 50)):
        weights = knot_weights(paths.times, some).T
        cycles = np.mod(paths.frequency * (paths.tau[0, 0] @ weights), 1.0)
        found.append(((paths.a[0, 0] @ weights) * np.exp(-2j * np.pi * cycles)).sum(axis=0))
    return np.concatenate(found)


def floor_db(series: ComplexArray, interval: float, speed: float, frequency: float) -> float:
    """Level under the peak of the strongest Doppler further than :data:`FAR` from the body's own; Blackman window."""
    count = 8 * len(series)
    spectrum = np.abs(np.fft.fft(series * blackman(len(series)), count)) ** 2
    doppler = -2 * speed * frequency / SPEED_OF_LIGHT  # of a channel; samples have it with the other sign
    away = np.fft.fftfreq(count, interval) - doppler
    away = np.abs((away + 0.5 / interval) % (1 / interval) - 0.5 / interval)
    return float(10 * np.log10(spectrum[away > FAR].max() / spectrum.max()))


def spurious(method: Method, count: int = 250, interval: float = 1e-3) -> float:
    """The floor of the method's subject, which translates."""
    times = interval * np.arange(count)
    return floor_db(slow_time(method, times), interval, SPEED, method_subject(method).frequency)


def method_subject(method: Any) -> Subject:
    found: Subject = method.subject
    return found


class AdcCheck:
    """Samples of a frame, some of them checked against the truth: those of random chirps at random times."""

    def __init__(self, subject: Subject, seed: int, count: int, store: Store | None = None) -> None:
        self.subject, wave = subject, subject.radar.waveform
        # Fewer are the first ones of more.
        drawn = np.random.default_rng(seed).random((count, 2))
        self.entries = (drawn * [wave.num_loops, wave.num_samples]).astype(np.int64)
        self._wave, self._store = wave, store or Store()
        self._expected: dict[bool, ComplexArray] = {}

    def expected(self, smooth: bool) -> ComplexArray:
        """(entry,) samples of the smooth surface or of the mesh as it is."""
        if smooth not in self._expected:
            self._expected[smooth] = self._integrated(smooth) if self.subject.quadrature else self._closed()
        return self._expected[smooth]

    def _cycles(self, tau: FloatArray, sample: int) -> FloatArray:
        """Of the beat signal, modulo 1."""
        wave = self._wave
        t = wave.sample_times[sample]
        return np.mod(tau * (wave.start_frequency + wave.slope * t - 0.5 * wave.slope * tau), 1.0)

    def _moments(self) -> list[tuple[float, float, int]]:
        """(time [s], frequency sent then [Hz], sample) of each entry."""
        wave = self._wave
        return [
            (
                float(wave.chirp_times[chirp, 0] + wave.sample_times[sample]),
                float(wave.start_frequency + wave.slope * wave.sample_times[sample]),
                int(sample),
            )
            for chirp, sample in self.entries
        ]

    def _closed(self) -> ComplexArray:
        """Of a point-like return: its own delay, with the level at the frequency of the moment."""
        subject = self.subject
        assert subject.expected is not None
        found = []
        for now, frequency, sample in self._moments():
            at = np.array([now])
            tau = 2 * subject.path(at) / SPEED_OF_LIGHT
            turns = np.exp(2j * np.pi * self._cycles(tau, sample))
            found.append((np.abs(subject.expected(at, frequency)) * turns)[0])
        return np.array(found)

    def _integrated(self, smooth: bool) -> ComplexArray:
        subject, probes = self.subject, []
        for now, frequency, _ in self._moments():
            # tau f - mu tau^2 / 2 for tau = 2 R / c; the samples have the conjugate of the channel's phase.
            x, y, z = (SPEED * now * subject.towards).tolist()
            square = -0.5 * self._wave.slope * (2 / SPEED_OF_LIGHT) ** 2
            eps = permittivity(subject.actors[0], frequency)
            probes.append(Probe((x, y, z), 2 * frequency / SPEED_OF_LIGHT, square, eps))
        return np.conj(integrals(subject, probes, self._store, smooth))

    def __call__(self, method: Method) -> dict[str, float]:
        """Relative error, and for the tracer the time of tracing and synthesising a frame of a run that goes on [s]."""
        wave, row = self._wave, {}
        if isinstance(method, Traced):
            radar, stop = self.subject.radar, wave.frame_length

            run = method.tracer.follow()

            def cube() -> ComplexArray:
                traced = method.tracer.trace(0.0, stop, run)
                parts = [each.select(self.subject.counted(each)) for each in traced.actors]
                return np.sum([synthesize(radar, each, 0.0, eps=0.3 * method.rtol) for each in parts], axis=0)

            cube()
            row["adc_seconds"], samples = timed(cube)
            found = samples[self.entries[:, 0], 0, 0, self.entries[:, 1]]
        else:
            found = np.empty(len(self.entries), complex)
            for index, (chirp, sample) in enumerate(self.entries):
                a, distance = method.returns(float(wave.chirp_times[chirp, 0]))
                tau = 2 * (distance + SPEED * wave.sample_times[sample]) / SPEED_OF_LIGHT
                found[index] = (np.conj(a) * np.exp(2j * np.pi * self._cycles(tau, sample))).sum()
        expected = self.expected(isinstance(method, (Traced, Tubes)))
        if self.subject.free_phase:
            turn = np.vdot(found, expected)
            found = found * turn / max(abs(turn), 1e-300)
        row["adc_relative"] = float(np.linalg.norm(found - expected) / np.linalg.norm(expected))
        return row


class Known:
    """What a subject returns at some times."""

    def __init__(self, subject: Subject, times: FloatArray, store: Store | None = None) -> None:
        self.subject, self.times, store = subject, times, store or Store()
        if subject.quadrature is None:
            assert subject.expected is not None
            self.smooth = self.flat = subject.expected(times, subject.frequency)
            return
        probes = [Probe.channel(SPEED * t * subject.towards, subject.frequency) for t in times]
        self.smooth = integrals(subject, probes, store)
        self.flat = integrals(subject, probes, store, smooth=False)
        fine = integrals(subject, probes[:1], store, oversampling=FINER)
        self.own_error = float(abs(self.smooth[0] / fine[0] - 1))
        """How far the quadrature is from one with twice as many points."""

    own_error = 0.0

    def errors(self, method: Method, found: ComplexArray) -> dict[str, float]:
        """Tracer and ray mode are held against the smooth surface that a mesh stands for, methods that see a
        polyhedron against that."""
        expected = (self.smooth if isinstance(method, (Traced, Tubes)) else self.flat)[: len(found)]
        return truth.errors(found, expected, self.subject.free_phase)


def integrals(
    subject: Subject, probes: list[Probe], store: Store, smooth: bool = True, oversampling: float = 1.0
) -> ComplexArray:
    """(probe,) of a subject that quadrature tells of; a mesh that is flat is its own smooth surface."""
    assert subject.quadrature is not None
    return store.sums(subject.quadrature(smooth, oversampling), probes, subject.hides)
