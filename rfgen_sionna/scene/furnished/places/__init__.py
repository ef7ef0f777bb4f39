"""Places, each a function that furnishes a plan from a random generator."""
