"""Functions that are compiled, and where their machine code comes from.

    functions   marks on what is compiled, which cost nothing until it is called
    entry       what Python calls
    flat        the arguments of an entry point as two arrays of numbers
    key         what the machine code of a function depends on
    library     machine code that was built before, for most that is called
    jit         numba, which compiles what is not in there, and keeps it between runs
    build       builds the library

numba is imported only where something has to be compiled.
"""

from feeder_sim.machine_code.entry import entry_point
from feeder_sim.machine_code.flat import lasting
from feeder_sim.machine_code.functions import (
    COMPILED,
    borrow,
    compiled,
    external,
    inlined,
    is_none,
    overload,
    uncounted,
)

__all__ = [
    "COMPILED",
    "borrow",
    "compiled",
    "entry_point",
    "external",
    "inlined",
    "is_none",
    "lasting",
    "overload",
    "uncounted",
]
