"""Put the law of a body on a mesh: stress of a strain, potentials and their state."""
