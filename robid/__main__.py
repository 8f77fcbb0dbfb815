"""Lets `python -m robid` do what `robid` does: this is where the process starts."""

import gc

from robid.interrupts import leave_at_once

leave_at_once()
# What a start imports stays: to look through it for garbage again and again takes a tenth of a short command's time.
gc.set_threshold(200_000, 20, 100)

from robid.cli import main  # noqa: E402

if __name__ == "__main__":
    main()
