"""`python -m symgen`."""

from symgen.console import BUILD, commands_of

if __name__ == "__main__":
    commands_of(BUILD)()
