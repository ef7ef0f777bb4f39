"""Texts of recipes for tests."""

SHORT = """
count = 40
prompts = ["a person waves", "a person claps"]
radar = "awr1843"
preset = "mmmesh"
"""

FULL = """
title = "a set"
count = 300
seed = 7
attempts = 5
prompts = ["a person waves", "a person claps", "a person does squats", "a person bows", "a person kicks"]
people = {choice = [1, 2], weights = [3, 1]}
motions = 50
places = {choice = ["free space", "furnished: an office", "a lab"], weights = [2, 1, 1]}
layouts = 12
distance_m = {range = [2.0, 3.0]}
azimuth_deg = [-10.0, 0.0, 10.0]
orientation_deg = {range = [-90.0, 90.0]}
duration_s = [0.5, 1.0]
receiver = [{adc = {bits = 16, full_scale_dbm = -26.0}}, {adc = {bits = 12, full_scale_dbm = "auto"}}]
rtol = 0.02
keep = ["adc", "labels", "joints"]
shard_size = "64 MB"

[bodies]
pool = 30
gender = ["female", "male"]
height_m = {range = [1.5, 1.9]}

[splits]
shares = {train = 0.7, validation = 0.1, test = 0.2}
by = ["body", "place", "action", "seed"]

[[radars]]
radar = "awr1843"
preset = "mmmesh"
position_m = {range = [[0.0, -0.1, 0.9], [0.0, 0.1, 1.1]]}

[[radars]]
name = "side"
radar = "iwr6843isk"
position_m = [0.0, 0.5, 1.2]
look_at_m = [3.0, 0.0, 1.0]
"""
