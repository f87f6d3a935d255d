"""How many threads linear algebra takes."""

import os

# The matrices here are small: threads that wait for one another make them several times slower, and what
# takes long fills the cores with processes.
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")


def take_one_thread() -> None:
    """Linear algebra takes one thread, unless the environment says otherwise; before numpy is imported."""
    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")
