"""`endotsr completion`: a script that completes commands and options in a shell."""

from dataclasses import dataclass
from typing import Annotated, Literal

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import parse


@dataclass
class CompletionOptions:
    """Print a script that completes the commands and options of endotsr.

    bash: endotsr completion bash > ~/.local/share/bash-completion/completions/endotsr.
    zsh: endotsr completion zsh > a folder of $fpath, as _endotsr.
    fish: endotsr completion fish > ~/.config/fish/completions/endotsr.fish.
    """

    shell: Annotated[Literal["bash", "zsh", "fish"], Option("bash|zsh|fish", positional=True)]
    """the shell"""


def run(words: list[str]) -> int:
    """The command."""
    from endotsr.cli.parts.completion import SCRIPTS

    options = parse(CompletionOptions, words, "completion")
    print(SCRIPTS[options.shell](), end="")
    return 0
