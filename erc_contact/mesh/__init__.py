"""Meshes whose parts have names: where they come from, the true shape, how ranks share them, rules on simplices."""
