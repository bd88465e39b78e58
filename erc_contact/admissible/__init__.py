"""From a solution to an admissible pair: a displacement and a stress with all properties but the constitutive law."""
