"""Faults of wording in documents and in the text of the code: banned phrases, spellings of units, long sentences.

Pure: text in, faults out. What is no prose is left out first: code fences, backticks, links' targets, keys, verdict names.
"""

import ast
import re
from pathlib import Path
from statistics import median
from typing import NamedTuple

MOST_WORDS = 40
MOST_MEDIAN = 18


class Fault(NamedTuple):
    """Where a text is hard to read, and what to write instead."""

    line: int
    phrase: str
    instead: str


_SAYS = 'the verb of the field: "estimated", "reported", "shown", "identified", "says" -> "reports"'
_NONE = '"no ...", "not available", "missing"'
_APART = '"cannot distinguish", "cannot be determined", "identifies", "shows", "reports"'
_LEFT = '"ignored", "skipped", "left unchanged"'
_CHORD = 'explain it at the first use, as in "the chord (slope of the straight line between two points)"'
_NATS = 'explain it at the first use, as in "nats (natural logarithm of a likelihood ratio)"'

BANNED = {
    r"\b(?:un)?told\b": _SAYS,
    r"\btell(?:s|ing)?\b": _APART,
    r"\b(?:is|are|was|were) (?-i:none)\b": _NONE,
    r"\blet be\b": _LEFT,
    r"\bnothing (?:is|was|can be|could be) \w+ of\b": '"no ... is reported", "not available"',
    r"\ba word of\b": '"a note on", or leave it out',
    r"\bsuch as it is\b": 'leave it out, or "as recorded"',
    r"\bthat (?:\w+ ){1,4}let be\b": _LEFT,
}
"""Phrases (pattern) and what to write instead."""

EXPLAINED = {r"\bchords?\b": _CHORD, r"\bnats?\b": _NATS}
"""Words of a trade that a document explains in brackets where it first uses them."""

UNITS = {
    r"(?<![\w*])m/s(?:\^|\*\*)?2\b": "m/s²",
    r"(?<![\w*])m/s(?:\^|\*\*)?3\b": "m/s³",
    r"\b(?:rad|deg)/s(?:\^|\*\*)?2\b": "rad/s²",
    r"(?<=[\d\[(] )N ?m\b|(?<=\[)N ?m\b|\bNm\b": "N·m",
    r"\bkg ?m(?:\^|\*\*)?2\b": "kg·m²",
    r"\+-|\+/-": "±",
}
"""Units as they are not to be written (pattern), and as they are."""

VERDICTS = frozenset({"cannot tell", "cannot_tell"})
_CODE = re.compile(r"``.*?``|`[^`]*`", re.S)
_FENCE = re.compile(r"^(\s*)(```+|~~~+).*?^\1\2\s*$", re.S | re.M)
_COMMENT = re.compile(r"<!--.*?-->", re.S)
_TAG = re.compile(r"\{%.*?%\}|\{\{.*?\}\}|\{#.*?#\}|<(?:script|style)\b.*?</(?:script|style)>|<[^>]*>", re.S)
_LINK = re.compile(r"!?\[([^\]]*)\]\([^)]*\)")
_CITATION = re.compile(r"\[(?:\d+|[a-z]+\d{4}\w?)(?:, ?(?:\d+|[a-z]+\d{4}\w?))*\]")
_ABBREVIATED = re.compile(r"\b(e\.g|i\.e|etc|vs|cf|Eq|Eqs|Fig|Figs|Ch|Sec|Tab|al|approx|resp|No|pp?)\.(?=[ \n])")
_ITEM = re.compile(r"^\s*(?:[-*+]|\d+[.)])\s+")
_PARAMETER = re.compile(r"^\s*\*{0,2}\w+(?:, \*{0,2}\w+)* :.*$", re.M)
_JS_TEXT = re.compile(r"\"(?:[^\"\\\n]|\\.)*\"|'(?:[^'\\\n]|\\.)*'|`(?:[^`\\]|\\.)*`", re.S)


def _blank(pattern: re.Pattern[str], text: str, by: str = " ") -> str:
    """Put `by` for what matches, with its line breaks, so that line numbers stay."""
    return pattern.sub(lambda m: by + "\n" * m.group().count("\n"), text)


def _line(text: str, at: int) -> int:
    return text.count("\n", 0, at) + 1


def _is_explained(text: str, at: int) -> bool:
    """Whether a bracket follows the word in the same sentence."""
    return re.match(r"[^.;]{0,40}\(", text[at:]) is not None


def phrases(text: str, *, are_units: bool = True) -> list[Fault]:
    """Banned phrases and units of a text whose code is taken out already."""
    found = [
        Fault(_line(text, m.start()), m.group(), instead)
        for pattern, instead in BANNED.items()
        for m in re.finditer(pattern, text, re.I)
    ]
    for pattern, instead in EXPLAINED.items():
        first = re.search(pattern, text, re.I)
        if first and not _is_explained(text, first.end()):
            found.append(Fault(_line(text, first.start()), first.group(), instead))
    if are_units:
        found += [
            Fault(_line(text, m.start()), m.group(), f'"{right}"')
            for pattern, right in UNITS.items()
            for m in re.finditer(pattern, text)
        ]
    return sorted(set(found))


def prose_of(document: str) -> str:
    """A Markdown document without code, comments and the targets of its links; lines keep their numbers."""
    text = _blank(_COMMENT, _blank(_FENCE, document, ""), "")
    return _LINK.sub(r"\1", _blank(_CODE, text, "code"))


def sentences(document: str) -> list[tuple[int, str, bool]]:
    """Sentences of a Markdown document: line, text, and whether it ends in a full stop (headings are left out)."""
    blocks: list[tuple[int, list[str]]] = []
    is_open = False
    for number, line in enumerate(prose_of(document).splitlines(), 1):
        bare = line.strip().lstrip(">").strip()
        if not bare or bare.startswith("#") or re.fullmatch(r"[-=*_ ]{3,}", bare):
            is_open = False
        elif bare.startswith("|"):
            blocks += [(number, [c.strip()]) for c in bare.strip("|").split("|") if c.strip().endswith(".")]
            is_open = False
        elif _ITEM.match(line) or not is_open:
            blocks.append((number, [_ITEM.sub("", bare)]))
            is_open = True
        else:
            blocks[-1][1].append(bare)
    found = []
    for number, lines in blocks:
        text = _ABBREVIATED.sub(r"\1", "\n".join(lines))
        at = 0
        for part in re.split(r"(?<=[.!?])(?:[\"')\]*_]*)\s+(?=[\"'(\[*_]*[A-Z0-9`]|code\b)", text):
            start = text.find(part, at)
            at = start + len(part)
            if part.strip():
                ends = part.rstrip("\"')*_ ").endswith((".", "!", "?", ":"))
                found.append((number + text.count("\n", 0, start), " ".join(part.split()), ends))
    return found


def length(sentence: str) -> int:
    """Words of a sentence; citations in square brackets and bare signs are none."""
    return sum(1 for word in _CITATION.sub("", sentence).split() if re.search(r"\w", word))


def of_document(document: str) -> list[Fault]:
    """Faults of a Markdown document."""
    found = phrases(_blank(_CITATION, prose_of(document)))
    every = sentences(document)
    for line, sentence, _ in every:
        if (words := length(sentence)) > MOST_WORDS:
            found.append(
                Fault(line, f"{sentence[:60]} ...", f"sentences of at most {MOST_WORDS} words, not {words} words")
            )
    whole = [length(s) for _, s, ends in every if ends]
    if whole and median(whole) > MOST_MEDIAN:
        found.append(
            Fault(1, "the whole document", f"a median of at most {MOST_MEDIAN} words a sentence, not {median(whole):g}")
        )
    return sorted(found)


def _docstrings(tree: ast.AST) -> set[int]:
    """Ids of the constants that are statements of their own: docstrings, also those of attributes."""
    return {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr) and isinstance(n.value, ast.Constant)}


def _texts(tree: ast.AST, outside: frozenset[int] = frozenset()) -> list[tuple[ast.expr, str]]:
    """String literals with their text; an f-string is one text, with `x` for what it puts in."""
    inside = {id(v) for n in ast.walk(tree) if isinstance(n, ast.JoinedStr) for v in n.values}
    found: list[tuple[ast.expr, str]] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            parts = [str(v.value) if isinstance(v, ast.Constant) else "x" for v in node.values]
            found.append((node, "".join(parts)))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inside | outside:
            found.append((node, node.value))
    return found


def _is_prose(text: str) -> bool:
    """Whether a literal is a sentence rather than a key, a header or a unit."""
    return len(re.findall(r"[A-Za-z]{2,}", text)) >= 4 and " " in text


def of_python(source: str) -> list[Fault]:
    """Faults in docstrings and string literals of a module."""
    tree = ast.parse(source)
    lines = source.splitlines()
    docstrings = _docstrings(tree)
    found = []
    for node, text in _texts(tree):
        if text in VERDICTS or not re.search(r"\s", text.strip()):
            continue  # names and keys
        is_docstring = id(node) in docstrings
        prose = _blank(_CODE, text, "code")
        if is_docstring:
            prose = _blank(_PARAMETER, prose, "")
        for fault in phrases(prose, are_units=is_docstring or _is_prose(text)):
            own = range(node.lineno, (node.end_lineno or node.lineno) + 1)
            head = fault.phrase.split()[0]
            near = (n for n in own if head in lines[n - 1])
            line = node.lineno + fault.line - 1 if is_docstring else next(near, node.lineno)
            found.append(fault._replace(line=line))
    return sorted(set(found))


def of_template(source: str) -> list[Fault]:
    """Faults in the text of a jinja page."""
    return phrases(_blank(_CODE, _blank(_TAG, source)))


def of_javascript(source: str) -> list[Fault]:
    """Faults in the string literals of a script."""
    found = []
    for m in _JS_TEXT.finditer(source):
        text = m.group()[1:-1]
        if " " in text.strip() and text not in VERDICTS:
            text = re.sub(r"\$\{[^}]*\}", "x", text)
            first = _line(source, m.start())
            found += [f._replace(line=f.line + first - 1) for f in phrases(text, are_units=_is_prose(text))]
    return sorted(set(found))


def of_toml(source: str) -> list[Fault]:
    """Faults in the values and comments of a TOML file."""
    bare = re.sub(r"^\s*[\w.\"-]+\s*=|^\s*\[.*\]\s*$", "", source, flags=re.M)
    kept = "\n".join(line if _is_prose(line) else "" for line in bare.split("\n"))
    return phrases(_blank(_CODE, kept, "code"))


CHECKS = {".py": of_python, ".md": of_document, ".j2": of_template, ".js": of_javascript, ".toml": of_toml}


def faults(path: Path) -> list[Fault]:
    """Faults of one file."""
    return CHECKS[path.suffix](path.read_text(encoding="utf-8"))
