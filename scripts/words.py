"""Count words and names that the project avoids, against ceilings that may only fall; `make check` runs it.

Docstrings, comments and string literals of robot_dyn/ are counted, and the prose of README.md, docs/ and of the README
of each folder of the package. Blocks of code and code between backquotes are left out.

    python scripts/words.py              compare with the ceilings; exit code 1 if a count differs from its ceiling
    python scripts/words.py --show RULE  list all hits of one rule
    python scripts/words.py --lower      write counts below their ceilings as the ceilings
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]

# Each count of the tree. A count above its ceiling is an error; a count below it is one too, until the ceiling is
# lowered to it.
CEILINGS = {
    "opening": 0,
    "as of": 0,
    "what without noun": 0,
    "is told": 0,
    "says that": 0,
    "tells that": 0,
    "goes on": 0,
    "looks": 0,
    "believes": 0,
    "is no": 0,
    "of its own": 0,
    "behind": 1,
    "beside": 0,
    "anew": 0,
    "likewise": 0,
    "in place of": 0,
    "so many": 0,
    "but for": 0,
    "whatever": 0,
    "of which": 0,
    "the same holds": 0,
    "each": 0,
    "arguments": 0,
    "Any": 172,
}

# Rules that are counted by syntax; the others are regular expressions.
BY_SYNTAX = {
    "opening": "a docstring that begins with Of, As of, Its, Those, What, Whether, How, Where, Why, So many, Room for",
    "each": "a loop variable named each",
    "arguments": "a call with more than eight positional arguments",
    "Any": "Any, or an alias of it, in the signature of a public function, method or data class",
}
PHRASES = {
    "as of": r"as of",
    "what without noun": r"what (?:is|are|was|were|has|had|it|they|follows|acts|comes|varies|differs|holds)",
    "is told": r"(?:is|are|was|were|be|been) (?:told|said)",
    "says that": r"(?:say|says) (?:so|no|that|which|what|how|why|where|whether)",
    "tells that": r"(?:tell|tells) (?:so|that|which|what|how|why|where|whether|nothing)",
    "goes on": r"(?:go|goes|going|went) on",
    "looks": r"(?:look|looks|looked) (?:at|for|into)",
    "believes": r"(?:believe|believes|believed)",
    "is no": r"(?<!there\s)(?:is|are|was|were) no|none (?:is|are)|nothing acts",
    "of its own": r"of (?:its|their|one's) own|of yours|a user's own|by (?:itself|themselves)",
    "behind": r"behind",
    "beside": r"beside",
    "anew": r"anew",
    "likewise": r"likewise",
    "in place of": r"in place of",
    "so many": r"so many",
    "but for": r"but for",
    "whatever": r"whatever",
    "of which": r"of (?:which|whom)",
    "the same holds": r"the same (?:holds|is true)|so (?:does|do|is|are) (?:that|those|its) of",
}
PATTERNS = {rule: re.compile(rf"\b(?:{phrase})\b".replace(" ", r"\s+")) for rule, phrase in PHRASES.items()}
OPENING = re.compile(r"\s*(?:As of|Of|Its|Those|What|Whether|How|Where|Why|So many|Room for)\b")
MAX_ARGUMENTS = 8
STRING_OR_COMMENT = re.compile(
    r'''"""(?:\\.|.)*?"""|"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*'|#(?P<comment>[^\n]*)''', re.DOTALL
)
CODE = re.compile(r"(`+)[^`]+?\1")
FENCE = re.compile(r"^(?:```|~~~|:::).*?^(?:```|~~~|:::)[^\S\n]*$", re.MULTILINE | re.DOTALL)
COMMENTS = re.compile(r"<!--.*?-->|^---\n.*?^---$", re.MULTILINE | re.DOTALL)
LINKS = re.compile(r"\]\([^)\s]*\)")


parsed = cache(ast.parse)  # each module is read for its aliases, and again for its hits


@dataclass(frozen=True, order=True)
class Hit:
    """A place where a rule is broken: file, line and the text there."""

    path: str
    line: int
    rule: str
    text: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.rule}: {self.text}"


def in_prose(text: str, path: str, first_line: int = 1) -> Iterator[Hit]:
    """Return the hits of all phrases in a text without markup."""
    text = _blanked(CODE, text)
    lower = text.lower()
    for rule, pattern in PATTERNS.items():
        for match in pattern.finditer(lower):
            line = first_line + text.count("\n", 0, match.start())
            yield Hit(path, line, rule, _context(text, match))


def in_page(text: str, path: str) -> Iterator[Hit]:
    """Return the hits of all phrases in a Markdown page, without its code, comments and addresses."""
    for markup in (COMMENTS, FENCE, LINKS):
        text = _blanked(markup, text)
    return in_prose(text, path)


def in_code(text: str, path: str, aliases: Iterable[str] = ("Any",)) -> Iterator[Hit]:
    """Return the hits of all rules in a module; `aliases` are the names of Any in it."""
    tree = parsed(text)
    for match in STRING_OR_COMMENT.finditer(text):
        if match["comment"]:
            yield from in_prose(match["comment"], path, 1 + text.count("\n", 0, match.start()))
    for node in ast.walk(tree):
        match node:
            case ast.Constant(value=str(literal)):
                yield from in_prose(literal, path, node.lineno)
            case ast.Module() | ast.ClassDef() | ast.FunctionDef() | ast.AsyncFunctionDef():
                docstring = ast.get_docstring(node, clean=False) or ""
                if OPENING.match(docstring):
                    yield Hit(path, node.body[0].lineno, "opening", docstring.strip().partition("\n")[0])
            case ast.For() | ast.AsyncFor() | ast.comprehension():
                for name in ast.walk(node.target):
                    if isinstance(name, ast.Name) and name.id == "each":
                        yield Hit(path, name.lineno, "each", ast.unparse(node.target))
            case ast.Call() if len(node.args) > MAX_ARGUMENTS:
                yield Hit(path, node.lineno, "arguments", f"{ast.unparse(node.func)}, {len(node.args)} by position")
    yield from _untyped(tree, path, set(aliases))


def _untyped(tree: ast.Module, path: str, aliases: set[str]) -> Iterator[Hit]:
    """Return a hit for each parameter, result or field whose annotation contains a name of Any."""
    for owner, annotation in _annotations(tree.body, ""):
        if annotation is not None and _names(annotation) & aliases:
            yield Hit(path, annotation.lineno, "Any", f"{owner}: {ast.unparse(annotation)}")


def _annotations(body: Iterable[ast.stmt], owner: str) -> Iterator[tuple[str, ast.expr | None]]:
    """Return the annotations of public functions, of methods of public classes and of fields of data classes."""
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and _is_public(node.name):
            named = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            variable = [x for x in (node.args.vararg, node.args.kwarg) if x is not None]
            yield from ((f"{owner}{node.name}({x.arg})", x.annotation) for x in named + variable)
            yield f"{owner}{node.name}()", node.returns
        elif isinstance(node, ast.ClassDef) and _is_public(node.name):
            yield from _annotations(node.body, f"{owner}{node.name}.")
            if _has_fields(node):
                fields = (field for field in node.body if isinstance(field, ast.AnnAssign))
                yield from ((f"{owner}{node.name}.{ast.unparse(x.target)}", x.annotation) for x in fields)


def _is_public(name: str) -> bool:
    return not name.startswith("_") or (name.startswith("__") and name.endswith("__"))


def _has_fields(node: ast.ClassDef) -> bool:
    """Return whether a class is a data class or a named tuple, whose fields are its signature."""
    return any("dataclass" in _names(x) for x in node.decorator_list) or any(
        _names(base) & {"NamedTuple", "TypedDict"} for base in node.bases
    )


def _names(expression: ast.expr) -> set[str]:
    """Return all names in an annotation, those in quoted parts included."""
    names = {x.id for x in ast.walk(expression) if isinstance(x, ast.Name)}
    names |= {x.attr for x in ast.walk(expression) if isinstance(x, ast.Attribute)}
    for node in ast.walk(expression):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            try:
                names |= _names(ast.parse(node.value, mode="eval").body)
            except SyntaxError:
                continue
    return names


def aliases_of(modules: Mapping[str, str]) -> dict[str, set[str]]:
    """Return the names of Any in each module, by dotted name: Any itself, aliases, and aliases that it imports."""
    aliases: dict[str, set[str]] = {name: {"Any"} for name in modules}
    sources = {name: list(_sources(parsed(text))) for name, text in modules.items()}
    changes = True
    while changes:
        changes = False
        for name, definitions in sources.items():
            new = {alias for alias, home, names in definitions if aliases.get(home or name, set()) & names}
            changes = changes or not new <= aliases[name]
            aliases[name] |= new
    return aliases


def _sources(tree: ast.Module) -> Iterator[tuple[str, str, set[str]]]:
    """Return the names that a module imports or defines as types, with the module and the names they come from."""
    for node in [*tree.body, *(x for block in tree.body if isinstance(block, ast.If) for x in block.body)]:
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from ((x.asname or x.name, node.module, {x.name}) for x in node.names)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            if isinstance(node.value, ast.Name | ast.Subscript | ast.BinOp):
                yield from ((x.id, "", _names(node.value)) for x in targets if isinstance(x, ast.Name))


def _blanked(markup: re.Pattern[str], text: str) -> str:
    """Replace markup by spaces, so that lines keep their numbers."""
    return markup.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)


def _context(text: str, match: re.Match[str]) -> str:
    around = text[max(0, match.start() - 30) : match.end() + 30]
    return " ".join(around.split())


def hits() -> list[Hit]:
    """Return all hits in the tree, by file and line."""
    package = ROOT / "robot_dyn"
    texts = {path: path.read_text(encoding="utf-8") for path in sorted(package.rglob("*.py"))}
    dotted = {path: ".".join(path.relative_to(ROOT).with_suffix("").parts) for path in texts}
    names = {path: name.removesuffix(".__init__") for path, name in dotted.items()}
    stubs = {path: path.with_suffix(".pyi") for path in texts}  # which list what a folder exports
    exports = {path: stub.read_text(encoding="utf-8") if stub.exists() else "" for path, stub in stubs.items()}
    aliases = aliases_of({names[path]: f"{text}\n{exports[path]}" for path, text in texts.items()})
    all_hits = [hit for path, text in texts.items() for hit in in_code(text, _place(path), aliases[names[path]])]
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), *sorted(package.rglob("*.md"))]
    all_hits += [hit for path in pages for hit in in_page(path.read_text(encoding="utf-8"), _place(path))]
    return sorted(all_hits)


def _place(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def complaints(counts: Mapping[str, int], ceilings: Mapping[str, int]) -> list[str]:
    """Return one line for each count that differs from its ceiling."""
    over = [
        f"{rule}: {counts[rule]} hits, the ceiling is {ceiling}: reword the new ones"
        for rule, ceiling in ceilings.items()
        if counts[rule] > ceiling
    ]
    under = [
        f"{rule}: {counts[rule]} hits, the ceiling is {ceiling}: lower it by `python scripts/words.py --lower`"
        for rule, ceiling in ceilings.items()
        if counts[rule] < ceiling
    ]
    return over + under


def lowered(source: str, counts: Mapping[str, int], ceilings: Mapping[str, int]) -> str:
    """Return the source of this script with the ceilings that counts are below."""
    for rule, ceiling in ceilings.items():
        source = source.replace(f'    "{rule}": {ceiling},\n', f'    "{rule}": {min(counts[rule], ceiling)},\n', 1)
    return source


def added_lines() -> dict[str, set[int]] | None:
    """Return the lines added since the ceilings were last changed, by file; None without a git history."""

    def git(*arguments: str) -> str:
        return subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True).stdout

    try:
        since = git("log", "-1", "--format=%H", "--", "scripts/words.py").strip()
        changes = git("diff", "--unified=0", "--find-renames", "--no-color", "--no-ext-diff", since)
        untracked = git("ls-files", "--others", "--exclude-standard").splitlines()
    except (OSError, subprocess.CalledProcessError):
        return None
    lines = {path: set(range(1, 100_000)) for path in untracked}
    path = ""
    for line in changes.splitlines():
        if line.startswith("+++ "):
            path = line[4:].removeprefix("b/")
        elif hunk := re.match(r"@@ \S+ \+(\d+)(?:,(\d+))? @@", line):
            start, length = int(hunk[1]), int(hunk[2] or 1)
            lines.setdefault(path, set()).update(range(start, start + length))
    return lines


def main() -> int:
    """Compare the counts with the ceilings, or list the hits of one rule."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("--show", choices=list(CEILINGS), metavar="RULE", help=f"one of {', '.join(CEILINGS)}")
    parser.add_argument("--lower", action="store_true", help="write counts below their ceilings as the ceilings")
    options = parser.parse_args()
    rule, all_hits = options.show, hits()
    if rule is not None:
        print(f"{rule}: {BY_SYNTAX.get(rule, PHRASES.get(rule))}")
        print("\n".join(str(hit) for hit in all_hits if hit.rule == rule))
        return 0
    counts = {name: sum(hit.rule == name for hit in all_hits) for name in CEILINGS}
    if options.lower:
        Path(__file__).write_text(lowered(Path(__file__).read_text(), counts, CEILINGS))
        return 0
    lines = complaints(counts, CEILINGS)
    over, added = {name for name in counts if counts[name] > CEILINGS[name]}, added_lines()
    new = [hit for hit in all_hits if hit.rule in over and (added is None or hit.line in added.get(hit.path, ()))]
    print("\n".join([*map(str, new), *lines]) or f"words: {sum(counts.values())} hits, each count at its ceiling")
    return int(bool(lines))


if __name__ == "__main__":
    sys.exit(main())
