"""Lower the error for the same displacement: a stress of less complementary energy, computed patch by patch."""
