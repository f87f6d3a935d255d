"""``python -m experiments.bench.learning``: the rows of `experiments.bench.learning.ticks` alone."""

from experiments.bench.learning.ticks import learning

if __name__ == "__main__":
    for name, _, value, unit, yardstick, _ in learning():
        print(f"{name:44} {value:8.3g} {unit}, {value / yardstick:.2f} of what is allowed")
