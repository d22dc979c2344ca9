"""Published figures, tables and claims as data, measured again: one file per paper, and the explicit list of them."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

from shadowbench.errors import InputError
from shadowbench.validation import did_you_mean

if TYPE_CHECKING:
    from shadowbench.reproduce.items import Item


@dataclass(frozen=True)
class PaperEntry:
    """A paper's line in the list.

    Attributes
    ----------
    name : key, also of the module.
    title : authors and year.
    """

    name: str
    title: str

    def load(self) -> tuple[Item, ...]:
        """Import the paper's items, and with them neither Numba nor matplotlib."""
        items: tuple[Item, ...] = import_module(f"shadowbench.reproduce.{self.name}").ITEMS
        return items


ALL_PAPERS: tuple[PaperEntry, ...] = (
    PaperEntry("sen2003", "Sen, Cammarano, Hanrahan 2003"),
    PaperEntry("chan2004", "Chan, Durand 2004"),
    PaperEntry("hertel2009", "Hertel, Hormann, Westermann 2009"),
    PaperEntry("sintorn2011", "Sintorn, Olsson, Assarsson 2011"),
    PaperEntry("sintorn2014", "Sintorn, Kämpe, Olsson, Assarsson 2014"),
    PaperEntry("new", "New: what none of the papers has"),
)


def all_items() -> tuple[Item, ...]:
    """List the items of all papers, in order."""
    return tuple(item for paper in ALL_PAPERS for item in paper.load())


def find_items(what: str) -> tuple[Item, ...]:
    """Select items by ``all``, ``PAPER``, ``PAPER/ITEM`` or ``ITEM``.

    Raises
    ------
    InputError
        If there is no such item, with the one that was probably meant.
    """
    items = all_items()
    chosen = tuple(item for item in items if what in ("all", item.paper, item.id, f"{item.paper}/{item.id}"))
    if not chosen:
        papers = [paper.name for paper in ALL_PAPERS]
        known = [f"{item.paper}/{item.id}" for item in items] if "/" in what else [
            *papers, *(item.id for item in items), "all", "list"]
        spelled = {word.lower(): word for word in known}
        hint = did_you_mean(what, spelled)
        for lower, word in spelled.items():
            hint = hint.replace(f"'{lower}'", f"'{word}'")
        raise InputError(f"nothing to reproduce is called '{what}'; {hint} `shadowbench reproduce list` shows all")
    return chosen
