"""What each command does between its arguments and its exit code; `stage` runs a single stage."""
