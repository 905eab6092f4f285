"""A large graph with the shape of an INS/GNSS filter: covariance of a Kalman filter, one measurement at a time."""

from strapdown.kernel.trace import Tracer

__all__ = ["kalman_graph"]


def sum_of(terms):
    """The sum of a list, balanced."""
    while len(terms) > 1:
        terms = [left + right for left, right in zip(terms[::2], terms[1::2], strict=False)] + terms[len(terms) & ~1:]
    return terms[0]


def kalman_graph(pool, *, states=13, measurements=7):
    """Graph of ``x, P = update(x, P, F, z)``, with ``P`` symmetric and ``F`` from the inputs.

    P is propagated as F P Fᵀ + Q; each measurement is of one state, with a division, and a root that limits its
    innovation. With the default sizes the graph has about 3,500 operations.
    """
    xp, names = Tracer(pool, ("PREDICT", "CORRECT")), range(states)
    transition = [[xp.source("input", f"f{row}_{column}") if abs(row - column) < 3 else None for column in names]
                  for row in names]
    mean = [xp.source("state", f"x{row}") for row in names]
    covariance = [[xp.source("state", f"p{min(row, column)}_{max(row, column)}") for column in names] for row in names]

    def product(rows, columns):
        pairs = [(a, b) for a, b in zip(rows, columns, strict=True) if a is not None]
        return sum_of([a * b for a, b in pairs])

    def symmetric(entry):
        upper = {(row, column): entry(row, column) for row in names for column in names if column >= row}
        return [[upper[min(row, column), max(row, column)] for column in names] for row in names]

    with xp.section("PREDICT"):
        mean = [product(transition[row], mean) for row in names]
        moved = [[product(transition[row], [line[column] for line in covariance]) for column in names] for row in names]
        covariance = symmetric(lambda row, column: product(transition[column], moved[row]) + 0.01 * (row == column))
    with xp.section("CORRECT"):
        for index in range(measurements):
            gain, before = [line[index] for line in covariance], covariance
            innovation = xp.source("input", f"z{index}") - mean[index]
            inverse = 1 / (gain[index] + 0.25)
            limited = innovation / xp.maximum(1.0, xp.sqrt(innovation * innovation * inverse))
            scaled = [value * inverse for value in gain]
            mean = [value + factor * limited for value, factor in zip(mean, scaled, strict=True)]
            covariance = symmetric(lambda row, column, before=before, scaled=scaled, gain=gain:
                                   before[row][column] - scaled[row] * gain[column])
    state = {f"x{row}": mean[row] for row in names}
    state |= {f"p{row}_{column}": covariance[row][column] for row in names for column in names if column >= row}
    inputs = [f"f{row}_{column}" for row in names for column in names if abs(row - column) < 3]
    return xp.graph(
        inputs=(*inputs, *(f"z{index}" for index in range(measurements))),
        outputs={f"out{row}": xp.settled(mean[row]) for row in names}, state=dict.fromkeys(state, 1.0),
        next_state={word: xp.settled(symbol, word) for word, symbol in state.items()})
