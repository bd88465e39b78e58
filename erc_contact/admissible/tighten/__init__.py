"""Tighten the stress: minimise its complementary energy for the same displacement."""
