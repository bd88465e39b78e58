"""Make, refine and distribute meshes whose parts have names.

Here is also what is known of the true shape of a body, and rules on simplices.
"""
