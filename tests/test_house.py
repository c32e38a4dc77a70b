"""The size of the house: a number here only falls."""

import ast
from pathlib import Path
from statistics import median

import pytest

import aqualog
from tests.conftest import LONG

PACKAGE = Path(aqualog.__file__).parent
TESTS = Path(__file__).parent

MOST_LINES = 98_059
MOST_FILES = 504
MOST_TEST_LINES = 73_129
MEDIAN_MODULE = 182
LONGEST_MODULE = 500
LONGEST_FUNCTION = 100
MOST_PARAMETERS = 10
WIDE = {"detect", "evaluate", "_step", "_scan"}
"""Functions that have more parameters: two of the Python face, two compiled ones."""


def lines(folder):
    return {p: len(p.read_text(encoding="utf-8").splitlines()) for p in sorted(folder.rglob("*.py"))}


def functions(path):
    return [n for n in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(n, ast.FunctionDef)]


def parameters(function):
    given = function.args
    every = [*given.posonlyargs, *given.args, *given.kwonlyargs, *filter(None, (given.vararg, given.kwarg))]
    return [a for a in every if a.arg not in ("self", "cls")]


def is_framed(function):
    """Whether the frame of commands reads its parameters: they are the options of a command."""
    return any("command(" in ast.unparse(d) for d in function.decorator_list)


def test_lines_and_files():
    sizes = lines(PACKAGE)
    assert sum(sizes.values()) <= MOST_LINES
    assert len(sizes) <= MOST_FILES
    assert sum(lines(TESTS).values()) <= MOST_TEST_LINES
    assert median(sizes.values()) <= MEDIAN_MODULE


@pytest.mark.parametrize("package", sorted(p.name for p in PACKAGE.iterdir() if (p / "__init__.py").exists()))
def test_modules_and_functions(package):
    sizes = lines(PACKAGE / package)
    assert not {p.name: n for p, n in sizes.items() if n > LONGEST_MODULE}
    for path in sizes:
        for function in functions(path):
            own = f"{path.relative_to(PACKAGE)}:{function.name}"
            assert (function.end_lineno or 0) - function.lineno < LONGEST_FUNCTION, own
            if not is_framed(function) and function.name not in WIDE:
                assert len(parameters(function)) <= MOST_PARAMETERS, own


def test_long_modules_are_there():
    assert [name for name in LONG if not (TESTS / name).is_file()] == []
