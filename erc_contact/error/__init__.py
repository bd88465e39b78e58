"""The error in the constitutive relation of an admissible pair, and the bounds on numbers that follow from it."""
