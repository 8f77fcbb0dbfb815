"""The model while the slide moves: `frozen` is the truth it is held beside; then `figures` and `page`."""
