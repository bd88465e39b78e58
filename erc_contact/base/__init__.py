"""What every module may use: errors, checks of arguments, progress, interrupts, the formatting of numbers."""
