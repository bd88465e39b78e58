"""What every module of namedmesh may use: errors, arguments, ranks, progress, words."""
