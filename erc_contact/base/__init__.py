"""Errors, checks of arguments, progress, and whatever else every module may use."""
