"""Components that are also descriptions: ports, latency and twin can be read without making a circuit."""

from amaranth.lib import wiring

__all__ = ["Described"]


class Described(wiring.Component):
    """Base of the components that can be read without becoming part of a circuit.

    Such a component is a description: ports (``signature``), ``latency``, ``interval``, and the software twin
    ``compute``. It becomes a circuit when ``elaborate`` is called. Schedules, tables, pages and command lines need
    only the description.
    """

    def __new__(cls, *args, **kwargs):
        # Amaranth's own ``__new__`` registers each component, and warns of those that are never elaborated.
        # A description does not have to be elaborated.
        return object.__new__(cls)
