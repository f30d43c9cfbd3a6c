"""Options that the user wrote on the command line."""

import typer


def given_options(context: typer.Context) -> dict[str, str]:
    """Options that the user wrote, without those at their default."""
    given = {}
    for one in context.command.params:
        name = str(one.name)
        # A command that Python calls without a command line has no sources.
        if getattr(context.get_parameter_source(name), "name", "DEFAULT") != "DEFAULT":
            given[name] = one.opts[0]
    return given
