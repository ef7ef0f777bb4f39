"""What is wrong with a method's answer: of instants, of the spectrum of a body that only translates, of ADC samples."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.signal.windows import blackman

from rfgen_sionna.records import SPEED_OF_LIGHT, ComplexArray, FloatArray, RadarPaths, knot_weights
from rfgen_sionna.signal import synthesize
from tests.benchmarks import truth
from tests.benchmarks.measuring import timed
from tests.benchmarks.methods import Method, Traced
from tests.benchmarks.subjects import SPEED, Subject, permittivity

FAR = 150.0
"""Doppler [Hz] beyond the body's own that counts as spurious."""


def slow_time(method: Method, times: FloatArray) -> ComplexArray:
    """(time,) channel at each time: instant by instant, but of the tracer from one trace."""
    if isinstance(method, Traced):
        paths = method.tracer.trace(times[0], times[-1]).moving
        return over_time(paths.select(method.subject.counted(paths)), times)
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

    def __init__(self, subject: Subject, seed: int, count: int) -> None:
        self.subject, wave = subject, subject.radar.waveform
        rng = np.random.default_rng(seed)
        self.entries = np.column_stack([rng.integers(0, n, count) for n in (wave.num_loops, wave.num_samples)])
        self._wave = wave
        self._expected: dict[bool, ComplexArray] = {}

    def expected(self, smooth: bool) -> ComplexArray:
        """(entry,) samples of the smooth surface or of the mesh as it is."""
        if smooth not in self._expected:
            self._expected[smooth] = np.array([self._true(*entry, smooth) for entry in self.entries])
        return self._expected[smooth]

    def _cycles(self, tau: FloatArray, sample: int) -> FloatArray:
        """Of the beat signal, modulo 1."""
        wave = self._wave
        t = wave.sample_times[sample]
        return np.mod(tau * (wave.start_frequency + wave.slope * t - 0.5 * wave.slope * tau), 1.0)

    def _true(self, chirp: int, sample: int, smooth: bool) -> complex:
        subject, wave = self.subject, self._wave
        now = wave.chirp_times[chirp, 0] + wave.sample_times[sample]
        frequency = wave.start_frequency + wave.slope * wave.sample_times[sample]
        if subject.quadrature is None:
            # Of a point-like return: its own delay, with the level at the frequency of the moment.
            level = np.abs(subject.expected_at(np.array([now]), frequency))
            tau = 2 * subject.path(np.array([now])) / SPEED_OF_LIGHT
            return complex((level * np.exp(2j * np.pi * self._cycles(tau, sample)))[0])
        total, offset = 0j, SPEED * now * subject.towards
        for weight, distance in subject.quadrature(smooth).strengths(
            offset, permittivity(subject.actors[0], frequency)
        ):
            cycles = self._cycles(2 * distance / SPEED_OF_LIGHT, sample)
            total += (np.conj(weight) * np.exp(2j * np.pi * cycles)).sum()
        return complex(total)

    def __call__(self, method: Method) -> dict[str, float]:
        """Relative error, and for the tracer the time of tracing and synthesising the frame [s]."""
        wave, row = self._wave, {}
        if isinstance(method, Traced):
            radar, stop = self.subject.radar, wave.frame_length

            def cube() -> ComplexArray:
                paths = method.tracer.trace(0.0, stop).moving
                return synthesize(radar, paths.select(self.subject.counted(paths)), 0.0, eps=0.3 * method.rtol)

            cube()
            row["adc_seconds"], samples = timed(cube)
            found = samples[self.entries[:, 0], 0, 0, self.entries[:, 1]]
        else:
            found = np.empty(len(self.entries), complex)
            for index, (chirp, sample) in enumerate(self.entries):
                a, distance = method.returns(float(wave.chirp_times[chirp, 0]))
                tau = 2 * (distance + SPEED * wave.sample_times[sample]) / SPEED_OF_LIGHT
                found[index] = (np.conj(a) * np.exp(2j * np.pi * self._cycles(tau, sample))).sum()
        expected = self.expected(isinstance(method, Traced))
        if self.subject.free_phase:
            turn = np.vdot(found, expected)
            found = found * turn / max(abs(turn), 1e-300)
        row["adc_relative"] = float(np.linalg.norm(found - expected) / np.linalg.norm(expected))
        return row


class Known:
    """What a subject returns at some times."""

    def __init__(self, subject: Subject, times: FloatArray) -> None:
        self.subject, self.times = subject, times
        self.smooth = subject.expected(times)
        self.flat = self.smooth if subject.flat_expected is None else subject.flat_expected(times)

    def errors(self, method: Method, found: ComplexArray) -> dict[str, float]:
        """The tracer is held against the smooth surface that a mesh stands for, methods that see a polyhedron against
        that."""
        expected = (self.smooth if isinstance(method, Traced) else self.flat)[: len(found)]
        return truth.errors(found, expected, self.subject.free_phase)
