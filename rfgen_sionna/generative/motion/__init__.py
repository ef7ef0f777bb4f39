"""Motion of people: actions by name, one interface for every source, clips from files."""

from rfgen_sionna.generative.motion.actions import ACTIONS, Action
from rfgen_sionna.generative.motion.kinematic import KinematicSource
from rfgen_sionna.generative.motion.motion_source import MotionSource
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, MEAN_ADULT, PARENTS, Skeleton

__all__ = ["ACTIONS", "JOINT_NAMES", "MEAN_ADULT", "PARENTS", "Action", "KinematicSource", "MotionSource", "Skeleton"]
