"""Finds cycles of imports, those within functions and for types included: `python -m tests.import_cycles`.

It prints one cycle and exits with 1 if there is one.
"""

import sys

import grimp
from graphlib import CycleError, TopologicalSorter

PACKAGES = ("mrl_driver", "sim_arduino", "ros1_bridge")


def main() -> int:
    """Build the graph of all modules; 1 if it has a cycle."""
    graph = grimp.build_graph(*PACKAGES, cache_dir=None)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        print("these modules import each other:", " -> ".join(error.args[1]))
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
