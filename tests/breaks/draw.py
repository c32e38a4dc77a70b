"""Breaks of one token each, drawn at random from the code of the package."""

from __future__ import annotations

import ast
import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

SWAPS: dict[type[ast.AST], str] = {
    ast.Lt: ">=", ast.LtE: ">", ast.Gt: "<=", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "==", ast.In: "not in", ast.NotIn: "in", ast.Is: "is not",
    ast.IsNot: "is", ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.And: "or", ast.Or: "and",
}  # fmt: skip
SPELT: dict[type[ast.AST], str] = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=", ast.In: "in", ast.NotIn: "not in", ast.Is: "is",
    ast.IsNot: "is not", ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.And: "and", ast.Or: "or",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Break:
    """One change of one line, from 1, of a file, from the root of the checkout.

    Bytes `start` to `end` of the line are replaced: there stands `old`, and comes `new`. It stands in `function`.
    """

    path: str
    line: int
    start: int
    end: int
    old: str
    new: str
    function: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line} {self.function}: {self.old} -> {self.new}"

    def applied(self, text: str) -> str:
        """The file's text with the break in it."""
        lines = text.splitlines(keepends=True)
        raw = lines[self.line - 1].encode()
        assert raw[self.start : self.end].decode() == self.old
        lines[self.line - 1] = (raw[: self.start] + self.new.encode() + raw[self.end :]).decode()
        return "".join(lines)


def drawn(root: Path, count: int, seed: int) -> list[Break]:
    """`count` breaks of the package below `root`: a function by chance, each as likely as its lines are many, then a place in it."""
    functions = [
        (path, node) for path in sorted((root / "aqualog").rglob("*.py")) for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
    ]  # fmt: skip
    chance, found = random.Random(seed), []
    lengths = [(node.end_lineno or node.lineno) - node.body[0].lineno + 1 for _, node in functions]
    while len(found) < count:
        path, node = chance.choices(functions, lengths)[0]
        places = list(_places(path, node, root))
        if places and (one := chance.choice(places)) not in found:
            found.append(one)
    return found


def _places(path: Path, function: ast.FunctionDef, root: Path) -> Iterator[Break]:
    lines = path.read_text(encoding="utf-8").splitlines()
    name = path.relative_to(root).as_posix()
    for node in (inner for statement in function.body for inner in ast.walk(statement)):
        if isinstance(node, ast.Constant) and type(node.value) in (int, float, bool) and node.lineno == node.end_lineno:
            new = str(not node.value) if isinstance(node.value, bool) else repr(node.value + 1)
            raw = lines[node.lineno - 1].encode()[node.col_offset : node.end_col_offset].decode()
            yield Break(name, node.lineno, node.col_offset, node.end_col_offset or 0, raw, new, function.name)
        if isinstance(node, ast.If) and node.test.lineno == node.test.end_lineno:
            raw = lines[node.test.lineno - 1].encode()[node.test.col_offset : node.test.end_col_offset].decode()
            yield Break(
                name,
                node.test.lineno,
                node.test.col_offset,
                node.test.end_col_offset or 0,
                raw,
                f"not ({raw})",
                function.name,
            )
        yield from _operators(name, lines, node, function.name)


def _operators(name: str, lines: list[str], node: ast.AST, function: str) -> Iterator[Break]:
    if isinstance(node, ast.Compare):
        pairs = list(zip((node.left, *node.comparators), node.ops, node.comparators, strict=False))
    elif isinstance(node, ast.BinOp):
        pairs = [(node.left, node.op, node.right)]
    elif isinstance(node, ast.BoolOp):
        pairs = [(a, node.op, b) for a, b in zip(node.values, node.values[1:], strict=False)]
    else:
        return
    for left, operator, right in pairs:
        if left.end_lineno != right.lineno or type(operator) not in SWAPS:
            continue
        raw = lines[right.lineno - 1].encode()
        at = raw.find(SPELT[type(operator)].encode(), left.end_col_offset, right.col_offset)
        if at >= 0:
            old = SPELT[type(operator)]
            yield Break(name, right.lineno, at, at + len(old), old, SWAPS[type(operator)], function)
