"""Shell completion scripts for commands and options.

Out: the text of a script with the options of this version; print it again after an update. In other places the shell
completes file names. Location of the output of `endotsr --completion SHELL`:

    bash   ~/.local/share/bash-completion/completions/endotsr
    zsh    a folder of $fpath, as _endotsr
    fish   ~/.config/fish/completions/endotsr.fish
"""

import importlib
from typing import Any

from endotsr.cli.parts.commands import COMMANDS
from endotsr.cli.parts.fields import fields_of
from endotsr.cli.parts.mistakes import option_names
from endotsr.clips.simulator.scenes import SCENES

ALWAYS = ("--help", "--help-all", "--quiet", "--log-file")
SHARED_MODULE = {"demo": ("train", "TrainOptions")}  # command with the options of another command
CHOICES = {"golden": "SUBCOMMANDS"}  # table in the command's module whose keys are the possible first words
FIRST_WORDS = {
    "train": ("simulated",),
    "inspect": ("simulated",),
    "simulate": tuple(SCENES),
}


def words_of(command: str) -> list[str]:
    """The possible words after a command: its first words, then its options in the order of the help."""
    command_module, options = _module_and_options(command)
    found = list(getattr(command_module, CHOICES[command]) if command in CHOICES else FIRST_WORDS.get(command, ()))
    if options is not None:
        found += [word for word in option_names(fields_of(options)) if word not in ALWAYS]
    return [*found, *ALWAYS]


def options_of(command: str) -> type | None:
    """The class of the options of a command; None for golden, which has a class per first word."""
    return _module_and_options(command)[1]


def _module_and_options(command: str) -> tuple[Any, type | None]:
    module, name = SHARED_MODULE.get(command, (command, f"{command.capitalize()}Options"))
    found: Any = importlib.import_module(f"endotsr.cli.{module}")
    return found, getattr(found, name, None)


def bash() -> str:
    """Completion for bash."""
    cases = "\n".join(f'        {name}) words="{" ".join(words_of(name))}" ;;' for name in COMMANDS)
    return f"""# Completion of endotsr for bash.
_endotsr() {{
    local word="${{COMP_WORDS[COMP_CWORD]}}" words
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W "{" ".join(COMMANDS)} --help --version --completion" -- "$word"))
        return
    fi
    case "${{COMP_WORDS[1]}}" in
{cases}
        *) words="" ;;
    esac
    COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o default -o bashdefault -F _endotsr endotsr
"""


def zsh() -> str:
    """Completion for zsh."""
    cases = "\n".join(f"        {name}) compadd -- {' '.join(words_of(name))} ;;" for name in COMMANDS)
    described = "\n".join(f"        {_quoted(f'{name}:{about}')}" for name, about in COMMANDS.items())
    return f"""#compdef endotsr
# Completion of endotsr for zsh.
if (( CURRENT == 2 )); then
    local -a commands=(
{described}
    )
    _describe command commands
else
    case "$words[2]" in
{cases}
    esac
    _files
fi
"""


def fish() -> str:
    """Completion for fish."""
    lines = ["# Completion of endotsr for fish."]
    for name, about in COMMANDS.items():
        lines.append(f"complete -c endotsr -n __fish_use_subcommand -a {name} -d {_quoted(about)}")
        for word in words_of(name):
            given = f"-l {word.removeprefix('--')}" if word.startswith("--") else f"-a {word}"
            lines.append(f"complete -c endotsr -n '__fish_seen_subcommand_from {name}' {given}")
    return "\n".join([*lines, ""])


def _quoted(text: str) -> str:
    return "'" + text.replace("\\", "\\\\").replace("'", "'\\''") + "'"


SCRIPTS = {"bash": bash, "zsh": zsh, "fish": fish}
