"""The error in the constitutive relation of an admissible pair, and its bounds."""
