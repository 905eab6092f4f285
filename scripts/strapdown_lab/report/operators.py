"""The variants of operators that are measured, from the list of operators."""

from dataclasses import dataclass
from typing import Any

from strapdown_lab.operators import OPERATORS

__all__ = ["MEASURED", "MeasuredOperator"]


@dataclass(frozen=True)
class MeasuredOperator:
    """An operator with one set of parameters.

    Attributes
    ----------
    operator : str
        Its operation: the title of its table.
    component : type
        Its class.
    formats : tuple
        Positional parameters of the class, none for fixed point.
    parameters : dict
        Keyword parameters of the class.
    placed : bool
        True if it is also placed and routed, which takes minutes.
    """

    operator: str
    component: Any
    formats: tuple
    parameters: dict[str, Any]
    placed: bool

    def make(self):
        """A new component."""
        return self.component(*self.formats, **self.parameters)


MEASURED = tuple(
    MeasuredOperator(variants.title, entry.component, formats, parameters,
                     variants.placed(entry.component, formats, parameters))
    for entry in OPERATORS for variants in entry.measured for formats, parameters in variants.of(entry.component))
"""All measured operators, in the order of the tables."""
