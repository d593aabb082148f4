#!/usr/bin/env python3
"""Fails where a page names what is not there: check_docs.py ROOT [ALIDADE]

A relative link and its anchor, a source file in backticks, a test in backticks (`Suite.Name`, … for any letters); with
ALIDADE also an option of a command that its --help does not have. Lists and histories that others make are not read."""
import functools
import pathlib
import re
import subprocess
import sys

SOURCES = {".h", ".cpp", ".py", ".ts", ".mjs", ".sh", ".S", ".in"}
FOLDERS = ("src", "cli", "tools", "python", "web", "bench", "fuzz", "examples", "cmake", "debian", "docs")
NO_FILE = re.compile(r"\bx(_test)?\.\w+$|[*{}]|[A-Z]{3,}")  # `x.cpp`, `*_test.cpp`, `ROOM.h`
NOT_READ = {"CHANGELOG.md", "reference.md"}  # of the past, and generated


def pages(root):
    """Markdown pages of the repository, relative to its root."""
    found = [*root.glob("*.md"), *root.glob("docs/**/*.md"), *root.glob("examples/**/*.md"), *root.glob("bench/**/*.md")]
    return sorted(page.relative_to(root) for page in found if page.name not in NOT_READ)


def anchors(text):
    """Anchors that GitHub makes of a page's headings."""
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


def link_fault(page, link):
    if re.match(r"[a-z]+:", link):
        return None
    path, _, anchor = link.partition("#")
    target = page.parent / path if path else page
    if not target.exists():
        return f"links to {path}, which is not there"
    if anchor and anchor not in anchors(target.read_text()):
        return f"links to #{anchor}, which {target.name} does not have"
    return None


def source_names(root):
    """Every file of the repository's folders, and each path that ends in it: a page may name it from its room."""
    names = {file.name for file in root.iterdir() if file.is_file()}
    for folder in FOLDERS:
        for file in (root / folder).rglob("*"):
            if "node_modules" not in file.parts:
                parts = file.relative_to(root).parts
                names.update("/".join(parts[i:]) for i in range(len(parts)))
    return names


def tests(root):
    """Suite.Name of every test, parameters of suites aside."""
    found = set()
    for file in [*root.glob("src/**/*_test.cpp"), *root.glob("cli/**/*_test.cpp"), *root.glob("fuzz/*_test.cpp")]:
        found.update(f"{suite}.{name}" for suite, name in re.findall(r"\bTEST(?:_[FP])?\((\w+),\s*(\w+)\)", file.read_text()))
    return found


def test_fault(code, known):
    """`Suite.Name`, `Suite.*` and `…Part…` must be tests; what does not look like one is none of this."""
    suites = {name.split(".")[0] for name in known}
    suite = re.fullmatch(r"(\w+)\.[\w*…]+", code)
    if not (suite and suite[1] in suites) and not re.fullmatch(r"…[A-Z]\w+…?|[A-Z]\w+…", code):
        return None
    pattern = re.escape(code).replace("…", ".*").replace(r"\*", ".*")
    return None if any(re.fullmatch(pattern, name) for name in known) else f"names the test {code}, which is not there"


@functools.lru_cache(maxsize=None)
def help_of(alidade, *command):
    return subprocess.run([alidade, *command, "--help"], capture_output=True, text=True, check=False).stdout


def subcommands(help_text):
    return set(re.findall(r"^  ([\w-]+) ", help_text.partition("Subcommands:")[2], re.MULTILINE))


def option_faults(line, alidade):
    """Options of `alidade COMMAND …` that the command does not have."""
    for call in re.findall(r"\balidade ([a-z][^`|#]*)", line):
        command, words = [], call.split()
        while len(command) < len(words) and words[len(command)] in subcommands(help_of(alidade, *command)):
            command.append(words[len(command)])
        if command:
            for option in re.findall(r"(?<![\w-])--[a-z][\w-]*", call):
                if option != "--help" and not re.search(re.escape(option) + r"(?![\w-])", help_of(alidade, *command)):
                    yield f"alidade {' '.join(command)} has no {option}"


def line_faults(page, line, names, known_tests, alidade):
    for link in re.findall(r"\]\(([^)\s]+)\)", line):
        yield link_fault(page, link)
    for code in re.findall(r"`([^`]+)`", line):
        for name in re.findall(r"[\w./{}*-]+\.\w+\b", code):
            if pathlib.Path(name).suffix in SOURCES and not NO_FILE.search(name) and name not in names:
                yield f"names {name}, which is not there"
        yield test_fault(code, known_tests)
    if alidade:
        yield from option_faults(line, alidade)


def main(root, alidade=None):
    names, known_tests, faults = source_names(root), tests(root), []
    for page in pages(root):
        for number, line in enumerate((root / page).read_text().splitlines(), 1):
            faults += [f"{page}:{number}: {fault}" for fault in line_faults(root / page, line, names, known_tests, alidade) if fault]
    print("\n".join(faults) or f"docs ok ({len(pages(root))} pages)")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1]), *sys.argv[2:3]))
