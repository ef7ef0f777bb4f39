"""The model card's table says what the examination found."""

from training.motion.figures import table


def test_means_and_spreads_over_seeds_stand_beside_what_is_wanted():
    seeds = [
        {"recognised, seen wording": a, "foot slide [m/s]": b, "worst action, seen wording": worst}
        for a, b, worst in ((1.0, 0.004, {"walk": 0.8, "jump": 0.9}), (0.9, 0.002, {"walk": 0.9, "push": 0.7}))
    ]
    noise = [{"recognised, seen wording": 0.5}]
    lines = table({"seeds": seeds, "from noise": noise}).splitlines()
    assert lines[0].endswith("2 seeds")
    assert "| recognised, seen wording | 95.0 ± 7.1 % | 50.0 % | 95 % |" in lines
    # push was among the worst once, and no worse than the best of those named otherwise
    assert "| worst actions, seen wording | push 0.80, walk 0.85 |  | 0.80 |" in lines
    assert "| foot slide, all / walking [cm/s] | 0.3 ± 0.1 |  | 2 / 5 |" in lines
    assert not any("rhythm" in line for line in lines)
