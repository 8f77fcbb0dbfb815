"""Lets `python -m robid` do what `robid` does: this is where the process starts."""

import gc
import os

from robid.backends.threads import ONE_THREAD
from robid.interrupts import leave_at_once

leave_at_once()
# What a start imports stays: to look through it for garbage again and again takes a tenth of a short command's time.
gc.set_threshold(200_000, 20, 100)

# One BLAS thread here, too, unless the user says otherwise: matrices are small, and threads that wait for each other
# take three times the processor's time. It is read when NumPy is loaded.
for name, count in ONE_THREAD.items():
    os.environ.setdefault(name, count)

from robid.cli import main  # noqa: E402

if __name__ == "__main__":
    main()
