"""Run the subcommands of ``erc-contact``, which ``erc_contact/__main__.py`` calls.

Each takes the arguments of its command line, is collective, and returns 0 if the
accuracy is reached, 1 if it is not. What is refused is an error of the package.
"""
