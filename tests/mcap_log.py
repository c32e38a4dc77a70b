"""Write MCAP files with the format's own library, for tests."""

from contextlib import contextmanager
from pathlib import Path

from mcap.writer import Writer


@contextmanager
def writing(path: Path, profile: str = "", **options):
    with path.open("wb") as file:
        writer = Writer(file, **options)
        writer.start(profile=profile)
        yield writer
        writer.finish()
