"""`mrl completion`: shell completion of commands, options, ports and robots."""

import click
from click.shell_completion import get_completion_class


@click.command()
@click.argument("shell", type=click.Choice(["bash", "zsh"]))
def completion(shell: str) -> None:
    """Print a script for Tab completion of mrl in a shell.

    \b
    Examples:
      mrl completion bash > ~/.local/share/bash-completion/completions/mrl
      eval "$(mrl completion zsh)"              in ~/.zshrc, after compinit
    """
    found = get_completion_class(shell)
    assert found is not None
    root = click.get_current_context().find_root().command
    click.echo(found(root, {}, "mrl", "_MRL_COMPLETE").source())
