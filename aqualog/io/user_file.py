"""Read small files that a user writes as a whole, and refuse other files."""

from __future__ import annotations

from pathlib import Path

from aqualog.core.errors import ConfigError

__all__ = ["read_small"]


def read_small(path: Path, *, what: str, expected: str, largest: int) -> bytes:
    """The content of a file.

    Parameters
    ----------
    path : Path
    what : str
        What the file is to the user, e.g. `vehicle file`; used in errors.
    expected : str
        What kind of file it should be, e.g. `a TOML file`.
    largest : int
        Largest size of such a file. [byte]

    Raises
    ------
    ConfigError
        If the file is missing, too large or cannot be read, also for a device or a pipe: some have no end.
    """
    try:
        if path.exists() and not path.is_dir() and not path.is_file():
            raise ConfigError(f"{what} is a device or a pipe", where=str(path), expected=expected)
        if path.is_file() and path.stat().st_size > largest:
            raise ConfigError(f"{what} is larger than {largest // 2**20} MiB", where=str(path), expected=expected)
        return path.read_bytes()
    except ValueError as error:  # a NUL character
        raise ConfigError(
            f"{what} not found: no file has the name {str(path)[:60]!r}", hint="check the path"
        ) from error
    except FileNotFoundError as error:
        raise ConfigError(f"{what} not found", where=str(path), hint="check the path") from error
    except IsADirectoryError as error:
        raise ConfigError(f"{what} is a folder", where=str(path), expected=expected) from error
    except OSError as error:
        raise ConfigError(f"{what} cannot be read: {error.strerror}", where=str(path)) from error
