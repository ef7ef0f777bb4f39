"""Experiments on real recordings: trained on simulated data, tested on measured ones."""
