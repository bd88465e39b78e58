"""The contact solve: methods, elastic stiffness, condensed problem, Newton, first guesses. It ends in a Solution."""
