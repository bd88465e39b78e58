"""Put contacts on a mesh: both sides of an interface, normal, gap, friction, status."""
