"""Components that are also descriptions: they tell ports, latency and twin, whether or not they become a circuit."""

from amaranth.lib import wiring

__all__ = ["Described"]


class Described(wiring.Component):
    """Base of the components that are read without becoming part of a circuit.

    Such a component is two things. It is a description: ports (``signature``), ``latency``, ``interval``, the
    software twin ``compute``. And it is a circuit, as soon as ``elaborate`` is called. Schedules, tables, pages and
    command lines need the description only.
    """

    def __new__(cls, *args, **kwargs):
        # Amaranth's own ``__new__`` registers each component, to report those that become no part of a circuit.
        # A description need not become one.
        return object.__new__(cls)
