"""A scene on a mesh: numbers become Constants, callables become UFL, and what the scene promises is checked."""
