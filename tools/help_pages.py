#!/usr/bin/env python3
"""Man pages and bash's completion, made of what --help says: help_pages.py ALIDADE FOLDER"""
import pathlib
import re
import subprocess
import sys


def help_of(alidade, words):
    return subprocess.run([alidade, *words, "--help"], capture_output=True, text=True, check=True).stdout


def commands_of(text):
    """Names under `Subcommands:`."""
    part = text.partition("\nSubcommands:\n")[2].partition("\n\n")[0]
    return re.findall(r"^  ([a-z][\w-]*)", part, re.MULTILINE)


def pages(alidade, words=()):
    """(words of the command, its help) of a program and all its commands."""
    text = help_of(alidade, words)
    yield list(words), text
    for name in commands_of(text):
        yield from pages(alidade, (*words, name))


def man_page(words, text):
    """Roff of one help text: its own lines and columns are kept."""
    name = "-".join(["alidade", *words])
    summary = text.splitlines()[0]
    body = text.partition("\n")[2].replace("\\", "\\e")
    body = re.sub(r"^([.'])", r"\\&\1", body, flags=re.MULTILINE).replace("-", "\\-")
    return (f'.TH "{name.upper()}" 1 "" "alidade" "alidade manual"\n.SH NAME\n{name} \\- {summary}\n'
            f".SH DESCRIPTION\n.nf\n{body}.fi\n")


def completion(all_pages):
    """A function that offers the commands, and behind a command its options."""
    cases = []
    for words, text in all_pages:
        options = sorted(set(re.findall(r"(?<![\w-])--[a-z][\w-]*", text.partition("\nExamples:")[0])))
        cases.append(f'    "{" ".join(words)}") offered="{" ".join(commands_of(text) + options)}" ;;')
    known = " ".join(sorted({word for words, _ in all_pages for word in words}))
    return "\n".join([
        "# bash completion of alidade", "_alidade() {",
        '  local current="${COMP_WORDS[COMP_CWORD]}" command="" word offered=""',
        '  for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do',
        f'    case " {known} " in *" $word "*) command="${{command:+$command }}$word" ;; *) break ;; esac', "  done",
        '  case "$command" in', *cases, "  esac", '  COMPREPLY=($(compgen -W "$offered" -- "$current"))',
        "  [ ${#COMPREPLY[@]} -gt 0 ] || COMPREPLY=($(compgen -f -- \"$current\"))", "}",
        "complete -o filenames -F _alidade alidade", ""])


def main(alidade, folder):
    all_pages = list(pages(alidade))
    for part in ("man1", "completions"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    for words, text in all_pages:
        (folder / "man1" / ("-".join(["alidade", *words]) + ".1")).write_text(man_page(words, text))
    (folder / "completions" / "alidade").write_text(completion(all_pages))


if __name__ == "__main__":
    main(sys.argv[1], pathlib.Path(sys.argv[2]))
