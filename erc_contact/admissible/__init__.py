"""From a solution to an admissible pair: a displacement and a stress that satisfy all but the constitutive law."""
