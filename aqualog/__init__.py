"""Find aquaplaning in drive logs.

    import aqualog as aq

    car = aq.Vehicle.read("car.toml")
    drive = aq.read("drive.mf4", map="map.toml")
    result = aq.detect(drive, car)
    result.events, result.plot(), result.save("out")

Nothing heavy is imported here: each name is loaded when it is first used.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from aqualog import physics
    from aqualog.core.errors import AqualogError
    from aqualog.core.records import Signals
    from aqualog.core.vehicle import Vehicle
    from aqualog.face import thesis
    from aqualog.face.align import align
    from aqualog.face.cache import cache
    from aqualog.face.calibrate import calibrate
    from aqualog.face.campaign import Campaign
    from aqualog.face.detect import detect
    from aqualog.face.diagnose import diagnose
    from aqualog.face.drive import Drive, convert, read
    from aqualog.face.evaluate import evaluate
    from aqualog.face.init import init
    from aqualog.face.inspect import doctor, inspect
    from aqualog.face.simulate import simulate
    from aqualog.face.slip_slope import slip_slope
    from aqualog.face.trade import tyre_test
    from aqualog.face.validate import validate
    from aqualog.face.watch import watch
    from aqualog.model.term import Model

__version__ = "0.52.0"

_FACE = {
    "read": "aqualog.face.drive",
    "detect": "aqualog.face.detect",
    "slip_slope": "aqualog.face.slip_slope",
    "convert": "aqualog.face.drive",
    "Campaign": "aqualog.face.campaign",
    "align": "aqualog.face.align",
    "calibrate": "aqualog.face.calibrate",
    "doctor": "aqualog.face.inspect",
    "evaluate": "aqualog.face.evaluate",
    "init": "aqualog.face.init",
    "inspect": "aqualog.face.inspect",
    "diagnose": "aqualog.face.diagnose",
    "simulate": "aqualog.face.simulate",
    "validate": "aqualog.face.validate",
    "watch": "aqualog.face.watch",
    "tyre_test": "aqualog.face.trade",
    "Drive": "aqualog.face.drive",
    "Signals": "aqualog.core.records",
    "Vehicle": "aqualog.core.vehicle",
    "Model": "aqualog.model.term",
    "cache": "aqualog.face.cache",
    "physics": "aqualog.physics",
    "thesis": "aqualog.face.thesis",
    "AqualogError": "aqualog.core.errors",
}

_MODULES = ("physics", "thesis")

__all__ = [
    "AqualogError", "Campaign", "Drive", "Model", "Signals", "Vehicle", "__version__", "align", "cache", "calibrate",
    "convert", "detect", "diagnose", "doctor", "evaluate", "init", "inspect", "physics", "read", "simulate",
    "slip_slope", "thesis", "tyre_test", "validate", "watch",
]  # fmt: skip


class _Package(ModuleType):
    """The package: a function of the face keeps its name although a folder beside it bears the same one.

    The import system sets `aqualog.detect` to the folder as soon as something in it is imported.
    """

    def __setattr__(self, name: str, value: Any) -> None:
        if isinstance(value, ModuleType) and name in _FACE and value.__name__ != _FACE[name]:
            value.__class__ = _Folder
            _share(name)
        else:
            super().__setattr__(name, value)


class _Folder(ModuleType):
    """A folder beside a function of the same name, which has its modules too: `import aqualog.detect.stream as s`."""

    def __setattr__(self, name: str, value: Any) -> None:
        super().__setattr__(name, value)
        if isinstance(value, ModuleType):
            _share(self.__name__.rpartition(".")[2])


def _share(name: str) -> None:
    """Give a function that is loaded the modules of the folder with its name, as far as they are loaded."""
    folder, function = sys.modules.get(f"aqualog.{name}"), globals().get(name)
    if folder is not None and function is not None:
        own = {n: m for n, m in vars(folder).items() if getattr(m, "__name__", "") == f"aqualog.{name}.{n}"}
        kept = vars(function)  # of `thesis`, the face's module: its own functions go before modules of the folder
        kept.update({n: m for n, m in own.items() if isinstance(m, ModuleType) and n not in kept})


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> Any:
    """Load a name of the face."""
    if name not in _FACE:
        raise AttributeError(f"module 'aqualog' has no attribute {name!r}")
    module = import_module(_FACE[name])
    found = module if name in _MODULES else getattr(module, name)
    globals()[name] = found
    if name not in _MODULES and _FACE[name].startswith("aqualog.face."):
        _share(name)
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
