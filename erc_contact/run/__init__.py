"""Run adaptively and through loading histories; keep runs, and go on with them."""
