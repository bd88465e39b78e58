"""Read decks of CalculiX and Abaqus as whole models: a domain and its scene.

The cards that say what the mesh is are read by :mod:`namedmesh.deck_mesh`; here is what
the cards of materials, supports, loads, contacts and steps mean.
"""
