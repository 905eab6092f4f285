"""Long runs held against the twin: each update from the state before it, all at once."""

__all__ = ["checked_twin"]


def checked_twin(system, pool, inputs, before, after):
    """What the twin makes of updates that have been computed in another way.

    Parameters
    ----------
    system, pool : System, Pool
        Whose twin it is.
    inputs, before, after : dict
        Port or state word to an array with an element an update: inputs, and state before and after.

    Returns
    -------
    dict
        As ``System.update_twin``. Raises: RuntimeError if a bit of the state is not that of ``after``.
    """
    twin, to_bits = system.update_twin(pool, inputs, before), pool.format.to_bits
    for word, values in after.items():
        if differing := int((to_bits(twin[word]) != to_bits(values)).sum()):
            raise RuntimeError(f"{differing} of {values.size} updates of {word} are not the twin's")
    return twin
