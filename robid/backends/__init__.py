"""Where tasks run: one ordered map, in this process or in several."""
