"""What the README and the book print is what the commands print."""

import pytest

from tests.book import examples
from tests.forked import forking

SLOW = {"guide/big_batches.md", "guide/campaign.md"}
PAGES = [
    pytest.param(
        page,
        id=str(page.relative_to(examples.ROOT)),
        marks=[pytest.mark.nightly] if any(str(page).endswith(s) for s in SLOW) else [],
    )
    for page in examples.pages()
]


@pytest.fixture(scope="module")
def forked(tmp_path_factory):
    with forking(tmp_path_factory.mktemp("forked") / "socket", examples.environment()) as path:
        yield path


@pytest.mark.parametrize("page", PAGES)
def test_examples_are_true(page, tmp_path, forked):
    """The README's begin as a reader starts them; those of the book need no imports of their own."""
    _, faults = examples.check(page, tmp_path, forked="" if page.name == "README.md" else forked)
    assert not faults, "run `python -m tests.book.examples`\n" + "\n\n".join(map(str, faults))


def test_a_command_without_imports_ends_as_one_with(tmp_path, forked):
    said = []
    for where in ("", forked):
        with examples.Session(tmp_path / f"work{bool(where)}", where) as session:
            said.append(session.shell('mkdir a; cd a; aqualog help exit | tail -1; aqualog inspect "no such.csv"'))
    assert said[0] == said[1]
    assert said[0][0] > 0
    assert "no such.csv" in said[0][1][-1]


@pytest.mark.nightly
@pytest.mark.parametrize("page", [p for p in examples.pages() if any("long" in b.marks for b in examples.runnable(p))])
def test_long_examples_are_true(page, tmp_path):
    _, faults = examples.check(page, tmp_path, long=True)
    assert not faults, "run `python -m tests.book.examples`\n" + "\n\n".join(map(str, faults))


def written(tmp_path, text):
    page = tmp_path / "page.md"
    page.write_text(text, encoding="utf-8")
    work = tmp_path / "work"
    work.mkdir()
    return examples.check(page, work)


def test_output_is_compared_and_rewritten(tmp_path):
    text, faults = written(tmp_path, "# A\n\n```console\n$ echo one\ntwo\n$ seq 3\n1\n2\n3\n```\n")
    assert text == "# A\n\n```console\n$ echo one\none\n$ seq 3\n1\n2\n3\n```\n"
    assert [f.line for f in faults] == [4]


def test_more_output_follows(tmp_path):
    page = "```console\n$ seq 9\n1\n2\n...\n```\n"
    assert written(tmp_path, page) == (page, [])


def test_a_new_block_with_three_dots_keeps_as_many_lines(tmp_path):
    text, _ = written(tmp_path, "```console\n$ seq 9\na\nb\nc\n...\n```\n")
    assert text == "```console\n$ seq 9\n1\n2\n3\n...\n```\n"


def test_exit_codes_count(tmp_path):
    assert not written(tmp_path, "<!-- exit: 3 -->\n```console\n$ exit 3\n```\n")[1]
    (tmp_path / "other").mkdir()
    assert "exit code 3, not 0" in written(tmp_path / "other", "```console\n$ exit 3\n```\n")[1][0].why


def test_files_and_state_carry_over(tmp_path):
    text, faults = written(
        tmp_path,
        "<!-- file: a/b.toml -->\n```toml\nx = 1\n```\n\n```console\n$ cat a/b.toml > c\n```\n\n```console\n$ cat c\nx = 1\n```\n",
    )
    assert not faults
    assert "$ cat c\nx = 1\n" in text


def test_python_runs_in_one_session(tmp_path):
    text, faults = written(tmp_path, "```python\na = 1\n```\n\n```python\na + 1\n```\n\n```text\n5\n```\n")
    assert text.endswith("```text\n2\n```\n")
    assert len(faults) == 1


def test_python_that_fails_is_a_fault(tmp_path):
    assert "ZeroDivisionError" in written(tmp_path, "```python\n1 / 0\n```\n")[1][0].why


def test_what_is_not_run_stays(tmp_path):
    page = "<!-- not run -->\n```console\n$ false\nwhat\n```\n\n<!-- not run -->\n```python\n1 / 0\n```\n"
    assert written(tmp_path, page) == (page, [])


def test_what_takes_its_time_is_left_out(tmp_path):
    page = "<!-- long -->\n```console\n$ echo\nwhat\n```\n"
    assert written(tmp_path, page) == (page, [])


def test_the_command_is_this_checkout(tmp_path):
    from aqualog import __version__

    assert f"{__version__}\n" in written(tmp_path, "```console\n$ aqualog --version\n```\n")[0]


@pytest.mark.parametrize(
    ("a", "b", "equal"),
    [
        ("v 102 km/h", "v  102 km/h", True),
        ("peak 3.11", "peak 3.12", True),
        ("peak 3.11", "peak 3.14", False),
        ("12 events", "13 events", False),
        ("x 1,204 kg", "x 1,205 kg", True),
        ("found in 2.3 s", "found in 4 s", True),
        ('"tool_version": "0.9.9"', '"tool_version": "1.10.0"', True),
        ("none", "one", False),
    ],
)
def test_numbers_may_differ_by_rounding(a, b, equal):
    assert examples.same([a], [b]) is equal
