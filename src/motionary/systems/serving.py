"""Which systems a system is trained on and asks for when it answers: its roles, filled."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from motionary.systems.registry import find


def filled(name: str, sections: Callable[[str], Mapping[str, Any]] = lambda _: {}) -> dict[str, str]:
    """The system in each role that a system needs or asks for when it answers.

    Args:
        name: of the system.
        sections: the configuration of a system, by its name. The key that is called like a role says which system fills
            it; where the system's own has none, one that fills an earlier role may say it, as text2token's tokenizer
            is inverse alignment's; else it is the system of the role's name.
    """
    names: dict[str, str] = {}
    for role in dict.fromkeys((*find(name).needs, *find(name).serves_with)):
        told = (sections(other).get(role) for other in (name, *names.values()))
        names[role] = next(filter(None, told), role)
    return names


def served_by(names: Sequence[str], sections: Callable[[str], Mapping[str, Any]] = lambda _: {}) -> tuple[str, ...]:
    """These systems and every one that they ask for when they answer, each after those that it asks for; `sections` as
    for `filled`."""
    order: list[str] = []

    def visit(name: str) -> None:
        """Puts what a system asks for before it."""
        roles = filled(name, sections)
        for role in find(name).serves_with:
            visit(roles[role])
        if name not in order:
            order.append(name)

    for name in names:
        visit(name)
    return tuple(order)
