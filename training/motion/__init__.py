"""Training set, training and evaluation of the motion model."""
