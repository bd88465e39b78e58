"""Find the rigid motions of bodies and of faces, and which of them nothing holds."""
