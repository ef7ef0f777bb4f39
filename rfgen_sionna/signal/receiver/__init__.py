"""The receiver: impairments from the antennas to the ADC's words, one class each.

All levels are referred to the receiver input, where samples are square roots of watts.
"""
