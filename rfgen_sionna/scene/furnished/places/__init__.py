"""The places, each a function that furnishes a plan from a random generator."""
