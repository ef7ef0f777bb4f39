"""Training and evaluation of the generative models: run from the checkout, not part of the wheel. See README.md."""
