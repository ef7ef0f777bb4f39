"""Radar signal processing of simulated and measured cubes: spectra, angles, spectrograms, detections."""

from rfgen_sionna.processing.angle import compensate_tdm, find_directions, steering
from rfgen_sionna.processing.azimuth import DynamicRangeAngle, RangeAzimuth, drai, range_azimuth
from rfgen_sionna.processing.calibration import Calibration, estimate_calibration
from rfgen_sionna.processing.cfg_calibration import read_cfg_calibration
from rfgen_sionna.processing.demultiplex import demultiplex, select_profile, select_slot
from rfgen_sionna.processing.detection import cfar, local_maxima, refine_peaks
from rfgen_sionna.processing.displacement import Displacement, displacement
from rfgen_sionna.processing.pointcloud import PointCloud, point_cloud
from rfgen_sionna.processing.range_doppler_power import range_doppler_power
from rfgen_sionna.processing.spectrogram import DopplerTime, RangeTime, doppler_time, micro_doppler, range_time
from rfgen_sionna.processing.spectrum import (
    RangeDoppler,
    range_axis,
    range_doppler,
    range_spectrum,
    remove_static,
    velocity_axis,
)

__all__ = [
    "Calibration",
    "Displacement",
    "DopplerTime",
    "DynamicRangeAngle",
    "PointCloud",
    "RangeAzimuth",
    "RangeDoppler",
    "RangeTime",
    "cfar",
    "compensate_tdm",
    "demultiplex",
    "displacement",
    "doppler_time",
    "drai",
    "estimate_calibration",
    "find_directions",
    "local_maxima",
    "micro_doppler",
    "point_cloud",
    "range_axis",
    "range_azimuth",
    "range_doppler",
    "range_doppler_power",
    "range_spectrum",
    "range_time",
    "read_cfg_calibration",
    "refine_peaks",
    "remove_static",
    "select_profile",
    "select_slot",
    "steering",
    "velocity_axis",
]
