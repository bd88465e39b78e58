"""Put a scene on a mesh.

Numbers become Constants, callables become UFL, and what the scene promises is checked.
"""
