"""`aqualog help` as a user calls it."""

import os
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from aqualog.book.terminal import shown
from aqualog.book.topics import topics
from aqualog.cli.main import app


def ask(*words, env=None):
    return CliRunner().invoke(app, ["help", *words], env={"COLUMNS": "100", **(env or {})})


def test_topics_are_listed_with_their_summaries():
    result = ask()
    assert result.exit_code == 0
    assert "\x1b" not in result.stdout
    for page in topics():
        assert page.name in result.stdout or page.section in result.stdout
    assert max(map(len, result.stdout.splitlines())) <= 100


@pytest.mark.parametrize("page", topics(), ids=lambda p: p.address)
def test_a_page_is_shown(page):
    result = ask(page.address)
    assert result.exit_code == 0
    assert result.stdout.startswith(page.title[:60])


def test_a_word_finds_pages():
    result = ask("NO_COLOR")
    assert result.exit_code == 0
    assert "environment" in result.stdout


@pytest.mark.parametrize("name", ["detect", "plan", "campaign init", "aqualog slip-slope"])
def test_a_command_is_shown_with_its_options(name):
    result = ask(*name.split())
    assert result.exit_code == 0
    assert "--vehicle" in result.stdout or "aqualog slip-slope --help" in result.stdout


def test_a_word_that_is_nowhere():
    result = ask("enviromment")
    assert result.exit_code == 2
    assert result.stderr.startswith("error: no page")
    assert "aqualog help environment" in result.stderr
    assert result.stderr.count("\n") == 1


def test_of_the_installed_command():
    done = subprocess.run(
        [sys.executable, "-m", "aqualog", "help", "exit_codes"], capture_output=True, text=True, check=True,
        env={**os.environ, "COLUMNS": "100"},
    )  # fmt: skip
    assert done.stdout.startswith("Exit codes")


PAGE = """# Title of it

See [the map](map.md), [campaigns](../guide/big_batches.md#top) and [this](https://example.org/a).

![Slopes](../pictures/a.png)

```console
$ aqualog detect [x](y.md) --long-line-of-a-command-that-is-longer-than-the-width-of-the-page
```

| key | unit |
|---|---|
| `mass` | kg |
"""


def test_markdown_in_words():
    text = shown(PAGE, width=60, is_styled=False)
    assert "\x1b" not in text
    assert "See the map (→ map), campaigns (→ big_batches) and this" in text
    assert "https://example.org/a" in text
    assert "[picture: Slopes]" in text
    assert "[x](y.md) --long-line-of-a-command-that-is-longer-than-the-width-of-the-page\n" in text
    assert "mass" in text
    assert "pictures/a.png" not in text


def test_styles_are_those_of_any_terminal():
    text = shown(PAGE, width=60, is_styled=True)
    assert "\x1b[1;4mTitle of it" in text
    assert "38;2" not in text
    assert "\x1b]8" not in text
