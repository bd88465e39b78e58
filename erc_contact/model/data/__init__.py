"""Put data on a mesh: numbers, callables and tables, evaluated, integrated, bounded."""
