"""Lower the error for the same displacement by a stress of less energy."""
