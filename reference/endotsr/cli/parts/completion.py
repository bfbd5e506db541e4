"""Scripts that complete commands and options in a shell, made from the options of every command.

In: nothing. Out: the text of a script. The words are those of this version: the script is printed again after an
update. Where an option takes a file, or where nothing is known, the shell completes file names.
"""

import importlib
from typing import Any

from endotsr.cli.main import COMMANDS
from endotsr.cli.parts.fields import fields_of
from endotsr.cli.parts.mistakes import option_names

ALWAYS = ("--help", "--help-all", "--quiet", "--log-file")
# The options class of a command whose first word chooses what it does is that of the module's table.
CLASSES = {
    "demo": ("train", "TrainOptions"),
    "train": ("train", "TrainOptions"),
    "calibrate": ("calibrate", "CalibrateOptions"),
    "render": ("render", "RenderOptions"),
    "view": ("view", "ViewOptions"),
    "export": ("export", "ExportOptions"),
    "evaluate": ("evaluate", "EvaluateOptions"),
    "compare": ("compare", "CompareOptions"),
    "gradcheck": ("gradcheck", "GradcheckOptions"),
    "tradeoff": ("tradeoff", "TradeoffOptions"),
    "completion": ("completion", "CompletionOptions"),
}
FIRST_WORDS = {
    "bench": ("iteration", "stages", "scaling", "peers", "start", "all"),
    "golden": ("judge", "run", "generate", "reference", "negative"),
    "tradeoff": ("train",),
    "train": ("simulated",),
    "completion": ("bash", "zsh", "fish"),
}


def words_of(command: str) -> list[str]:
    """What may follow a command: its first words, then its options in the order of the help."""
    found: list[str] = list(FIRST_WORDS.get(command, ()))
    if command in CLASSES:
        module, name = CLASSES[command]
        options: Any = getattr(importlib.import_module(f"endotsr.cli.{module}"), name)
        found += [word for word in option_names(fields_of(options)) if word not in ALWAYS]
    return [*found, *ALWAYS]


def bash() -> str:
    """Completion for bash."""
    cases = "\n".join(f'        {name}) words="{" ".join(words_of(name))}" ;;' for name in COMMANDS)
    return f"""# Completion of endotsr for bash.
_endotsr() {{
    local word="${{COMP_WORDS[COMP_CWORD]}}" words
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W "{" ".join(COMMANDS)} --help --version" -- "$word"))
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
