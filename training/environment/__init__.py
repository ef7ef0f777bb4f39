"""Training set, training and evaluation of the models of surroundings: base, ControlNet, RF LoRA."""
