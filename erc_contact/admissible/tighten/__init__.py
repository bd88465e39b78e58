"""Less error from the same displacement: the admissible stress of least complementary energy, patch by patch."""
