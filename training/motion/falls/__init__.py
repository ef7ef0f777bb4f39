"""Falls, slips, faints and heavy sitting down of a jointed body, by physics: `python -m training.motion.falls`."""
