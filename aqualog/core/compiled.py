"""Compile recursions, and the physics that they call."""

from __future__ import annotations

import hashlib
import os
import stat
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numpy as np
from numba import config, njit
from numba.core.options import DefaultOptions
from numba.core.runtime import rtsys
from numpy.typing import NDArray

from aqualog.core.user_folders import code_folder

__all__ = ["compiled", "inlined", "kept_code", "load_kept", "part", "plain"]

_PATIENCE_S = 120.0  # the longest compilation takes a quarter of it on a slow machine
_LOOK_S = 0.05

# no counts of references: numba's own option for code that allocates nothing, left out where a numba has it no more
_UNCOUNTED: dict[str, bool] = {"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}

_inlined: dict[FunctionType, Any] = {}
_kept: list[Any] = []  # functions whose machine code is kept


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a recursion, and keep the machine code for the next process if there is a folder for it.

    A read-only installation without a home folder has no such folder; there each process compiles. No fast maths:
    results must not depend on how a drive is cut.

    The kept code is discarded when a module of `physics`, one beside the function or one in the folder of a called
    function changes. So it is when a constant from elsewhere changes. numba itself checks only the file of the function
    and would go on with an old equation.
    """
    # numba chooses the place while it decorates; beside the sources it would leave folders behind that an
    # uninstallation does not remove, and that hide an editable one
    own, config.CACHE_DIR = config.CACHE_DIR, config.CACHE_DIR or _user_cache()
    try:
        dispatcher = njit(cache=True, error_model="numpy", nogil=True)(function)
    except RuntimeError:
        return njit(function, error_model="numpy", nogil=True)
    finally:
        config.CACHE_DIR = own
    _load_lightly(dispatcher)
    _compile_in_turn(dispatcher)
    index: Any = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if hasattr(index, "_source_stamp"):  # numba's own attribute: without it, its own rule holds
        assert isinstance(function, FunctionType)
        index._source_stamp = (index._source_stamp, _stamp_of(function))
        _kept.append(dispatcher)
    return dispatcher


def part(function: Callable[..., Any], *, is_inline: bool = True, allocates: bool = False) -> Any:
    """Compile a part of a recursion, into the code of its caller: small functions with names cost no call.

    A part that allocates no array gets its arrays without counting references: atomic counts would take a quarter of
    the time of a simulation.
    """
    return njit(function, error_model="numpy", forceinline=is_inline, **({} if allocates else _UNCOUNTED))


def plain(*arrays: Any) -> list[NDArray[Any]]:
    """Return arrays as one machine code takes them all: contiguous and writable, copied where they are not."""
    return [np.require(x, None, ["C", "W"]) for x in arrays]


def kept_code() -> frozenset[tuple[str, int]]:
    """Return path and time of change of the kept machine code: a difference after some work shows a compilation."""
    place = config.CACHE_DIR or _user_cache()
    found = set()
    for path in Path(place).rglob("*.nb?") if place else ():
        with suppress(OSError):  # another process has put a newer one in its place
            found.add((str(path), path.stat().st_mtime_ns))
    return frozenset(found)


def load_kept() -> None:
    """Load what is kept of the functions so far that no other one calls: processes forked from this one have it."""
    called = {id(f) for d in _kept for f in map(d.py_func.__globals__.get, d.py_func.__code__.co_names)}
    for dispatcher in _kept:
        if id(dispatcher) not in called:
            with suppress(Exception):  # numba's own attributes, or a damaged file: each process loads it by itself
                for signature, *_ in dispatcher._cache._cache_file._load_index():
                    dispatcher.compile(signature)


def inlined(function: Callable[..., Any]) -> Any:
    """Make a pure function of `physics` callable inside a compiled recursion, on scalars.

    The one source serves arrays and the simulator. Keyword-only arguments become ordinary ones, which is all that
    numba knows; physics functions that it calls are taken along.
    """
    assert isinstance(function, FunctionType)
    if function not in _inlined:
        code = function.__code__
        code = code.replace(co_argcount=code.co_argcount + code.co_kwonlyargcount, co_kwonlyargcount=0)
        names = {n: function.__globals__[n] for n in code.co_names if n in function.__globals__}
        scope = function.__globals__ | {
            n: inlined(f) for n, f in names.items() if isinstance(f, FunctionType) and "aqualog.physics" in f.__module__
        }
        defaults = (
            *(function.__defaults__ or ()),
            *(function.__kwdefaults__ or {}).values(),
        )  # the last ones have them
        _inlined[function] = njit(
            FunctionType(code, scope, function.__name__, defaults), error_model="numpy", **_UNCOUNTED
        )
    return _inlined[function]


def _load_lightly(dispatcher: Any) -> None:
    """Load kept machine code without the parts that only compiling needs.

    numba fills its tables of implementations before it looks for kept code: a hundred modules, with SciPy where that
    is installed, 0.3 s in each process. A function that must be compiled after all has them filled by the compiler.
    """
    kept: Any = getattr(dispatcher, "_cache", None)
    if not hasattr(kept, "_load_overload") or not hasattr(kept, "_guard_against_spurious_io_errors"):
        return  # numba's own attributes: without them, its own way holds

    def load(signature: Any, target: Any) -> Any:
        rtsys.initialize(target)  # what allocates arrays in compiled code
        with kept._guard_against_spurious_io_errors():
            return kept._load_overload(signature, target)

    kept.load_overload = load


class _Turn:
    """The right to compile one function, which one process of this machine has at a time.

    A process that ends gives it back; one that keeps it for too long is not waited for.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: int | None = None

    def take(self) -> None:
        """Wait until no other process compiles the function; where files cannot be locked, nobody waits."""
        try:
            import fcntl

            if self._file is None:
                self._file = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        except (ImportError, OSError):
            return
        patience = time.monotonic() + _PATIENCE_S
        while time.monotonic() < patience:
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return
            except BlockingIOError:
                time.sleep(_LOOK_S)
            except OSError:
                return

    def give(self) -> None:
        """Let the next process compile, or find what was kept."""
        if self._file is not None:
            os.close(self._file)
            self._file = None


def _compile_in_turn(dispatcher: Any) -> None:
    """Compile a function in one process while others that need it wait for its kept code.

    The workers of a batch begin together: each would compile the same for many seconds.
    """
    kept: Any = getattr(dispatcher, "_cache", None)
    if not all(hasattr(kept, n) for n in ("load_overload", "save_overload", "_cache_path", "_impl")):
        return  # numba's own attributes: without them, each process compiles
    turn = _Turn(Path(kept._cache_path) / f"{kept._impl.filename_base}.turn")
    load_kept, keep = kept.load_overload, kept.save_overload

    def load(signature: Any, target: Any) -> Any:
        found = load_kept(signature, target)
        if found is None:
            turn.take()
            found = load_kept(signature, target)
            if found is not None:
                turn.give()
        return found

    def save(signature: Any, compiled_code: Any) -> None:
        try:
            # seen once, while others compiled the same: numba had no object to keep; this process has its code
            with suppress(RuntimeError):
                keep(signature, compiled_code)
        finally:
            turn.give()

    kept.load_overload, kept.save_overload = load, save


@cache
def _user_cache() -> str:
    """Return a folder for machine code in the user's cache; empty if no folder can be written.

    Its content is executed: it must be this user's, and nobody else may write to it.
    """
    try:
        folder = code_folder()
        folder.mkdir(parents=True, exist_ok=True)
        if hasattr(os, "geteuid"):
            state = folder.stat()
            if state.st_uid != os.geteuid():
                return ""
            if state.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
                folder.chmod(0o700)
    except (OSError, RuntimeError):
        return ""
    return str(folder) if os.access(folder, os.W_OK) else ""


def _stamp_of(function: FunctionType) -> str:
    """Return the state of all sources of a function's machine code."""
    folders = {Path(__file__).resolve().parents[1] / "physics"}
    constants: set[str] = set()
    _gather(function, folders, constants, set())
    return hashlib.sha256(repr((sorted(map(_stamp, folders)), sorted(constants))).encode()).hexdigest()


def _gather(function: FunctionType, folders: set[Path], constants: set[str], seen: set[FunctionType]) -> None:
    """Return the folders that a function refers to, and values of constants, which enter its machine code."""
    if function in seen:
        return
    seen.add(function)
    folders.add(Path(function.__code__.co_filename).parent)
    package = function.__module__.partition(".")[0]
    names = function.__code__.co_names
    found = {n: function.__globals__[n] for n in names if n in function.__globals__}
    for module in [x for x in found.values() if isinstance(x, ModuleType) and x.__name__.partition(".")[0] == package]:
        # `module.function`: both are among the names
        found |= {f"{module.__name__}.{n}": getattr(module, n) for n in names if hasattr(module, n)}
    for name, value in found.items():
        called = getattr(value, "py_func", None)
        if isinstance(called, FunctionType):
            _gather(called, folders, constants, seen)
        elif isinstance(value, int | float | str | tuple):
            constants.add(f"{name} = {value!r}")


@cache
def _stamp(folder: Path) -> str:
    state = [(f.name, f.stat().st_mtime_ns, f.stat().st_size) for f in sorted(folder.glob("*.py"))]
    return hashlib.sha256(repr(state).encode()).hexdigest()
