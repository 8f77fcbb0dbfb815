"""Lets `python -m robid` do what `robid` does."""

from robid.cli import main

if __name__ == "__main__":
    main()
