"""Print what makes a shell complete verbs, options and their choices after the Tab key.

Examples:
  greybed completion bash
  greybed completion bash > ~/.local/share/bash-completion/completions/greybed
  greybed completion zsh > ~/.zfunc/_greybed     # a folder in fpath, before compinit
  greybed completion fish > ~/.config/fish/completions/greybed.fish

What is printed needs neither greybed nor a network when it completes. Print it anew after an
update.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from importlib import import_module

SHELLS = ("bash", "zsh", "fish")


@dataclass(frozen=True)
class _Verb:
    """What can stand after a verb."""

    line: str
    first: tuple[str, ...]  # choices of the first word that is no option
    options: dict[str, tuple[str, bool, tuple[str, ...]]]  # name -> help, whether a word follows,
    #                                                          choices of that word


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``greybed completion``."""
    parser.add_argument("shell", choices=SHELLS, help="; ".join(SHELLS))


def run(options: argparse.Namespace) -> int:
    """Print the script."""
    verbs = _verbs()
    print({"bash": _bash, "zsh": _zsh, "fish": _fish}[options.shell](verbs), end="")
    return 0


def _verbs() -> dict[str, _Verb]:
    """Verbs with their arguments, from the parsers themselves."""
    from greybed.cli.main import VERBS

    found = {}
    for name, (module, line) in VERBS.items():
        parser = argparse.ArgumentParser(prog=f"greybed {name}")
        import_module(f"greybed.cli.{module}").add_arguments(parser)
        first: tuple[str, ...] = ()
        options = {}
        for action in parser._actions:  # the public interface has no way to list them
            choices = tuple(str(choice) for choice in action.choices or ())
            for word in action.option_strings:
                says = (action.help or "") % vars(action) if action.help else ""
                options[word] = (says, action.nargs != 0, choices)
            if not action.option_strings and not first:
                first = choices
        found[name] = _Verb(line, first, options)
    return found


def _bash(verbs: dict[str, _Verb]) -> str:
    cases = []
    for name, verb in verbs.items():
        lines = [f"    {name})", '      case "$before" in']
        # Options that take a word of any kind are left to the names of files.
        follow: dict[tuple[str, ...], list[str]] = {}
        for option, (_, word, choices) in verb.options.items():
            if word:
                follow.setdefault(choices, []).append(option)
        lines += [
            f"        {'|'.join(options)}) words='{' '.join(choices)}' ;;"
            for choices, options in follow.items()
        ]
        lines += [f"        *) words='{' '.join(verb.options)}' ;;", "      esac"]
        if verb.first:
            lines.append(
                f"""      [ "$COMP_CWORD" -eq 2 ] && words="$words {" ".join(verb.first)}\""""
            )
        cases.append("\n".join([*lines, "      ;;"]))
    body = "\n".join(cases)
    return f"""# Completion of greybed for bash, by greybed completion bash.
_greybed() {{
  local word="${{COMP_WORDS[COMP_CWORD]}}" before="${{COMP_WORDS[COMP_CWORD-1]}}" words=''
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=( $(compgen -W '{" ".join(verbs)} --help --version' -- "$word") )
    return
  fi
  case "${{COMP_WORDS[1]}}" in
{body}
  esac
  # Options only after a dash: else names of files are what is meant.
  case "$word" in
    -*) ;;
    *) words=$(printf '%s\\n' $words | grep -v '^-') ;;
  esac
  COMPREPLY=( $(compgen -W "$words" -- "$word") )
}}
complete -o bashdefault -o default -F _greybed greybed
"""


def _zsh(verbs: dict[str, _Verb]) -> str:
    # zsh runs completions that are written for bash.
    return f"#compdef greybed\nautoload -U +X bashcompinit && bashcompinit\n{_bash(verbs)}"


def _fish(verbs: dict[str, _Verb]) -> str:
    lines = ["# Completion of greybed for fish, by greybed completion fish."]
    for name, verb in verbs.items():
        lines.append(
            f"complete -c greybed -f -n __fish_use_subcommand -a {name} -d {_quoted(verb.line)}"
        )
        after = f"-n '__fish_seen_subcommand_from {name}'"
        if verb.first:
            lines.append(f"complete -c greybed {after} -a '{' '.join(verb.first)}'")
        for option, (says, word, choices) in verb.options.items():
            dashes = f"-l {option[2:]}" if option.startswith("--") else f"-s {option[1:]}"
            follow = f" -x -a '{' '.join(choices)}'" if choices else " -r" if word else ""
            lines.append(f"complete -c greybed {after} {dashes}{follow} -d {_quoted(says)}")
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"
