"""The adaptive run: where to refine, the optimal mesh, the loop, and its history."""
