"""From a solution to a displacement and a stress that satisfy all but Hooke's law."""
