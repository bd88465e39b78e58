"""Files, plots and pictures. Optional packages are imported inside the functions that need them."""
