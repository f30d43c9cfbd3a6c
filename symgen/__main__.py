"""`python -m symgen`."""

from symgen.command_list import BUILD
from symgen.console import commands_of

if __name__ == "__main__":
    commands_of(BUILD)()
