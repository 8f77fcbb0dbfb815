"""The experiment and robot files. Read `experiment`, `robot`, `fits`, `load`; what must hold is in `checks/`."""
