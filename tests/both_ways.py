"""The same work by the face and by the command, for tests that compare them."""

import json

import plotly.graph_objects as go
import polars as pl
import pytest

from aqualog.core.errors import ConfigError
from tests.commands import run


def command(*args, code=0):
    """What the command prints, and its notes."""
    done = run(*args)
    assert done.exit_code == code, done.stderr
    return done.stdout, done.stderr


def check_result(result, folder, *args, files, code=0):
    """Check that a result says what the command says, saves `files`, and can be shown."""
    as_json, notes = command(*args, "--json", code=code)
    assert result.to_json() + "\n" == as_json
    assert json.loads(as_json) == json.loads(json.dumps(result.document))
    assert result.text() == command(*args, code=code)[0]
    assert all(f"note: {n}" in notes.replace("\n  ", "\n") for n in result.notes)
    assert result.has_loss == (code == 3)
    check_shown(result)
    check_saved(result, folder, files)


def check_shown(result):
    """Check figure, tables and the short text."""
    assert isinstance(result.plot(), go.Figure)
    assert result.plot().data or result.plot().layout.annotations  # a sentence, where nothing can be drawn
    assert result.tables
    assert all(isinstance(t, pl.DataFrame) for t in result.tables.values())
    assert 0 < len(repr(result)) < 600
    assert len(repr(result).splitlines()) <= 9
    assert result._repr_html_().startswith("<pre>")


def check_saved(result, folder, files):
    """Check the files, and that they are not overwritten."""
    written = result.save(folder)
    assert [p.name for p in written] == list(files)
    assert sorted(p.name for p in folder.iterdir()) == sorted(files)
    before = {p: p.read_bytes() for p in written}
    with pytest.raises(ConfigError, match="exists already"):
        result.save(folder)
    result.save(str(folder), force=True)
    assert {p: p.read_bytes() for p in written} == before
