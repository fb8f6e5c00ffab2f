"""A law of impact of another package (docs/extending.md): one contact by its function, several one after the other.

The name of a mark in the records of the kinds holds the key of the function, so that machine code is of this function
and no other.
"""

from __future__ import annotations

import functools
from typing import Any

from feeder_sim import extensions
from feeder_sim.engines.impulse.contact_equations import EARLIER
from feeder_sim.engines.impulse.contact_problem import (
    FRICTION,
    IMPULSE,
    MOMENT,
    RESTITUTION,
    impact,
    push_alone,
    seen_alone,
)
from feeder_sim.engines.impulse.vectors import add_to, vector, write_to
from feeder_sim.errors import InputError
from feeder_sim.machine_code import compiled, overload
from feeder_sim.machine_code.flat import Kind
from feeder_sim.machine_code.functions import FOREIGN, Inner
from feeder_sim.machine_code.key import key_of

FLOAT = Kind("float")
VECTOR_OF = {n: Kind("tuple", None, inner=(FLOAT,) * n) for n in (3, 6)}
ROUNDS = 20  # of impacts of each contact; after them what still approaches is stopped
SLOW = 1e-9  # of the largest approach at first: what does not count


class _Functions:
    """The laws of this process by their marks: what choosers look up, and no constant of theirs."""

    def __init__(self) -> None:
        self.by_mark: dict[str, Inner] = {}


_functions = _Functions()


@functools.cache
def mark_of(name: str) -> str:
    """Mark of the law that another package declares under a name.

    Raises:
        InputError: it cannot be imported, is no function, or cannot be compiled.
    """
    from feeder_sim.machine_code import jit

    law = extensions.find("laws", name)
    function, key = getattr(law, "py_func", law), f"feeder_sim.laws: {name}"
    if not callable(function) or not hasattr(function, "__code__"):
        raise InputError(f"is {type(law).__name__}, must be a function of k, u, e, mu", key=key)
    compilable: Any = compiled(function)
    try:
        returned = jit.returned_by(compilable, (VECTOR_OF[6], VECTOR_OF[3], FLOAT, FLOAT))
    except Exception as error:  # of any kind: it is the code of somebody else
        reason = next((line for line in str(error).splitlines()[1:] if line.strip()), str(error))
        raise InputError(f"cannot be compiled: {reason.strip()}", key=key) from error
    if returned != VECTOR_OF[3]:
        raise InputError("returns something else, must be an impulse: a tuple of three floats", key=key)
    mark = f"{FOREIGN}{name}_{key_of(function)}"
    _functions.by_mark[mark] = compilable
    return mark


def law_of_mark(fields: Any) -> Inner | None:
    """The function of another package that a record with such fields is marked with, if any."""
    return next((_functions.by_mark[field] for field in fields if field.startswith(FOREIGN)), None)


def own_impulse(kind, k, u, e, mu):
    """Impulse of a contact that approaches, in its frame, as that of `impulse_at_point`."""
    raise NotImplementedError("for compiled code only")


@overload(own_impulse)
def _own_by_kind(kind, k, u, e, mu):
    law: Any = law_of_mark(kind.fields)
    return lambda kind, k, u, e, mu: law(k, u, e, mu)


@compiled
def own_impact(kind, bodies, contacts, n, closely, near):
    """As `impact` of contact_problem.py, each contact by itself, that which approaches fastest first.

    What still approaches after many of these impacts is stopped, all at once.
    """
    vectors, number, given = contacts.vector, contacts.number, contacts.room.value[EARLIER]
    for i in range(n):
        write_to(vectors[IMPULSE, i], (0.0, 0.0, 0.0))
        write_to(vectors[MOMENT, i], (0.0, 0.0, 0.0))
    enough = max(closely, near)
    for impacts in range(ROUNDS * n):
        fastest, next_one = -enough, -1
        for i in range(n):
            _, _, u = seen_alone(i, bodies, contacts)
            if u[2] < fastest:
                fastest, next_one = u[2], i
        if next_one < 0:
            return True
        if impacts == 0:
            enough = max(enough, -SLOW * fastest)
        frame, k, u = seen_alone(next_one, bodies, contacts)
        earlier = vector(vectors[IMPULSE, next_one])
        p = own_impulse(kind, k, u, number[RESTITUTION, next_one], number[FRICTION, next_one])
        push_alone(next_one, bodies, contacts, frame, p)
        add_to(vectors[IMPULSE, next_one], 1.0, earlier)
    for i in range(n):
        number[RESTITUTION, i] = 0.0
        for c in range(3):
            given[i, c] = vectors[IMPULSE, i, c]
    settled = impact(bodies, contacts, n, closely, near)
    for i in range(n):
        add_to(vectors[IMPULSE, i], 1.0, vector(given[i]))
    return settled
