"""Old names of moved modules, for programs written for earlier versions.

Each package passes its table to `keep`; `import old.name` then gives the module at its new place.
"""

import importlib
import sys
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_loader
from types import ModuleType
from typing import Dict, Optional, Sequence


class _OldNames(MetaPathFinder, Loader):
    """Finds modules by their old names.  It comes first, because a folder of an earlier checkout may be left over."""

    def __init__(self, moved: Dict[str, str]) -> None:
        self._moved = moved

    def find_spec(
        self, fullname: str, path: Optional[Sequence[str]] = None, target: Optional[ModuleType] = None
    ) -> Optional[ModuleSpec]:
        """Return a spec for an old name; None for any other."""
        return spec_from_loader(fullname, self) if fullname in self._moved else None

    def exec_module(self, module: ModuleType) -> None:
        """Make the old name refer to the module at its new place."""
        sys.modules[module.__name__] = importlib.import_module(self._moved[module.__name__])


def keep(moved: Dict[str, str]) -> None:
    """Make each old name (key) import the module at its new place (value)."""
    sys.meta_path.insert(0, _OldNames(moved))
