"""Where tasks run: `map`, in this process or in several; `progress` tells how far they are."""
